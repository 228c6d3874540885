//! Recordings that were spoilt on purpose: no fault leads the odometry far astray, and none goes by unnoticed.

#![allow(clippy::unwrap_used)]

mod common;

use std::{
    num::NonZeroUsize,
    path::{Path, PathBuf},
};

use common::{Ended, Run, gyre, odometry, real_data, recording};
use gyre_simulator::{Fault, FaultPlan, write_faulty};
use serde_json::Value;

/// Where `summary.json` counts the motions that the odometry doubted and did something about. Only here is it named.
const DOUBTED: &str = "/motions/doubtful";
/// Where it counts the scans that a recording lacks.
const MISSING: &str = "/missing";

/// How much further off a trajectory may be for a fault.
const FARTHER: f64 = 1.2;

/// Every 20th scan is spoilt, or every tenth dropped.
fn plan(fault: Fault) -> FaultPlan {
    let every = if fault == Fault::Dropped { 10 } else { 20 };
    FaultPlan {
        fault,
        every: NonZeroUsize::new(every).unwrap(),
        seed: 1,
    }
}

/// What came of a drive.
struct Outcome {
    spoilt: usize,
    ate_m: f64,
    seg_percent: f64,
    summary: Value,
}

impl Outcome {
    fn of(data: &Path, spoilt: usize) -> Self {
        let configuration =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/radiate.toml");
        let run = Run::of_file(&configuration).data(data).rate("max");
        run.complete();
        let summary = run.summary();
        let figure = |place| summary.pointer(place).and_then(Value::as_f64).unwrap();
        let (ate_m, seg_percent) = (
            figure("/evaluation/ate/rmse_m"),
            figure("/evaluation/seg/percent"),
        );
        Self {
            spoilt,
            ate_m,
            seg_percent,
            summary,
        }
    }

    fn with(fault: Fault, data: &Path) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let hits = write_faulty(data, folder.path(), &plan(fault)).unwrap();
        Self::of(folder.path(), hits.len())
    }

    /// `None`: the summary has no such count.
    fn count(&self, place: &str) -> Option<u64> {
        self.summary.pointer(place).and_then(Value::as_u64)
    }

    fn row(&self, name: &str, clean: &Self) -> String {
        let count = |place| {
            self.count(place)
                .map_or("-".to_owned(), |count| count.to_string())
        };
        let counts = ["/processed", "/unreadable", MISSING, "/breaks", DOUBTED].map(count);
        let counts: String = counts.iter().map(|count| format!("{count:>11}")).collect();
        let Self {
            spoilt,
            ate_m,
            seg_percent,
            ..
        } = self;
        format!(
            "{name:12}{spoilt:6}{ate_m:9.2}{:8.2}{seg_percent:8.2}{counts}",
            ate_m / clean.ate_m
        )
    }
}

fn print_table(clean: &Outcome, faulty: &[(Fault, Outcome)]) {
    println!(
        "fault       spoilt    ATE m   ratio   seg %  processed unreadable    missing     breaks    doubted"
    );
    println!("{}", clean.row("none", clean));
    for (fault, outcome) in faulty {
        println!("{}", outcome.row(fault.name(), clean));
    }
}

/// Asserts that each spoilt scan has added at least one to the count that its fault belongs to.
fn assert_counted(fault: Fault, clean: &Outcome, faulty: &Outcome) {
    let place = if fault == Fault::Dropped {
        MISSING
    } else {
        DOUBTED
    };
    let count = |outcome: &Outcome| {
        outcome
            .count(place)
            .unwrap_or_else(|| panic!("the summary has no {place}"))
    };
    let (before, after) = (count(clean), count(faulty));
    assert!(
        after >= before + faulty.spoilt as u64,
        "{fault}: {place} is {after} with {} spoilt scans, {before} without",
        faulty.spoilt
    );
}

#[test]
fn no_fault_leads_a_real_drive_astray_and_each_is_counted() {
    let Some(data) = real_data("radiate-2019-02-12") else {
        return;
    };
    let clean = Outcome::of(&data, 0);
    let faulty = Fault::ALL.map(|fault| (fault, Outcome::with(fault, &data)));
    print_table(&clean, &faulty);
    for (fault, outcome) in &faulty {
        assert!(
            outcome.ate_m <= FARTHER * clean.ate_m,
            "{fault}: {} m, {} m without",
            outcome.ate_m,
            clean.ate_m
        );
        assert_counted(*fault, &clean, outcome);
    }
}

/// The folder of a spoilt copy of the small recording, made on the command line.
fn spoilt_small(folder: &Path, fault: &str) -> PathBuf {
    let out = folder.join(fault);
    let mut command = gyre();
    command
        .arg("spoil")
        .arg(recording::small())
        .args(["--every", "10", "--fault", fault, "--out"])
        .arg(&out);
    let ended = Ended::of(command);
    assert!(
        ended
            .succeeded()
            .stdout
            .contains(&format!("with {fault} in 2 scans: 10 20")),
        "{}",
        ended.stdout
    );
    out
}

#[test]
fn scans_that_a_recording_lacks_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let run = Run::of_recording_named(spoilt_small(folder.path(), "dropped").to_str().unwrap());
    let rows = odometry::rows(&run.complete());
    assert_eq!(rows.len(), recording::SCANS - 1 - 2);
    odometry::assert_unbroken(&rows);
    assert_eq!(run.summary()["missing"], 2);
}

#[test]
fn a_spoilt_scan_is_a_scan_all_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let run = Run::of_recording_named(spoilt_small(folder.path(), "noise").to_str().unwrap());
    assert_eq!(odometry::rows(&run.complete()).len(), recording::SCANS - 1);
    assert_eq!(
        (&run.summary()["missing"], &run.summary()["unreadable"]),
        (&Value::from(0), &Value::from(0))
    );
}

#[test]
fn what_cannot_be_spoilt_is_told_in_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let spoil = |data: &Path, out: &str| {
        let mut command = gyre();
        command
            .arg("spoil")
            .arg(data)
            .args(["--fault", "noise", "--out"])
            .arg(folder.path().join(out));
        Ended::of(command)
    };
    spoil(&folder.path().join("none"), "new").refused_with(&["none", "no such folder"]);
    spoilt_small(folder.path(), "turned");
    spoil(recording::small(), "turned").refused_with(&["turned holds", "give an empty folder"]);
}
