//! Recordings that were corrupted on purpose: no fault leads the odometry far astray, and none goes
//! by unnoticed.

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::{
    common::{Ended, Run, odometry, real_data, recording},
    gyre_lab,
};

/// The place in `summary.json` of the count of doubtful motions.
const DOUBTED: &str = "/motions/doubtful";
/// The place of the count of scans that a recording lacks.
const MISSING: &str = "/missing";

/// Maximum ratio of the error of a trajectory with a fault to that without.
const FARTHER: f64 = 1.2;

/// All faults, each with how often it strikes.
const FAULTS: [(&str, usize); 5] = [
    ("noise", 20),
    ("later", 20),
    ("turned", 20),
    ("half-blank", 20),
    ("dropped", 10),
];

/// The result of a drive.
struct Outcome {
    corrupted: usize,
    ate_m: f64,
    seg_percent: f64,
    summary: Value,
}

impl Outcome {
    fn of(data: &Path, corrupted: usize) -> Self {
        let configuration = Path::new(crate::PROJECT).join("configs/radiate.toml");
        let run = Run::of_file(&configuration).data(data).rate("max");
        // The program ends with code 1 if many motions are weak. The results are there.
        run.finish();
        let summary = run.summary();
        let figure = |place| summary.pointer(place).and_then(Value::as_f64).unwrap();
        let (ate_m, seg_percent) = (
            figure("/evaluation/ate/rmse_m"),
            figure("/evaluation/seg/percent"),
        );
        Self {
            corrupted,
            ate_m,
            seg_percent,
            summary,
        }
    }

    fn with(fault: &str, every: usize, data: &Path) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let ended = corrupt(data, fault, every, folder.path());
        let (_, hits) = ended.succeeded().stdout.split_once(": ").unwrap();
        Self::of(folder.path(), hits.split_whitespace().count())
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
            corrupted,
            ate_m,
            seg_percent,
            ..
        } = self;
        format!(
            "{name:12}{corrupted:6}{ate_m:9.2}{:8.2}{seg_percent:8.2}{counts}",
            ate_m / clean.ate_m
        )
    }
}

fn print_table(clean: &Outcome, faulty: &[(&str, Outcome)]) {
    println!(
        "fault       corrupted    ATE m   ratio   seg %  processed unreadable    missing     breaks    doubted"
    );
    println!("{}", clean.row("none", clean));
    for (fault, outcome) in faulty {
        println!("{}", outcome.row(fault, clean));
    }
}

/// Asserts that each corrupted scan has added at least one to the count that its fault belongs to.
fn assert_counted(fault: &str, clean: &Outcome, faulty: &Outcome) {
    let place = if fault == "dropped" { MISSING } else { DOUBTED };
    let count = |outcome: &Outcome| {
        outcome
            .count(place)
            .unwrap_or_else(|| panic!("the summary has no {place}"))
    };
    let (before, after) = (count(clean), count(faulty));
    assert!(
        after >= before + faulty.corrupted as u64,
        "{fault}: {place} is {after} with {} corrupted scans, {before} without",
        faulty.corrupted
    );
}

#[test]
#[ignore = ".ci/nightly: whole drives"]
fn no_fault_leads_a_real_drive_astray_and_each_is_counted() {
    let Some(data) = real_data("radiate-2019-02-12") else {
        return;
    };
    let clean = Outcome::of(&data, 0);
    let faulty = FAULTS.map(|(fault, every)| (fault, Outcome::with(fault, every, &data)));
    print_table(&clean, &faulty);
    for (fault, outcome) in &faulty {
        assert!(
            outcome.ate_m <= FARTHER * clean.ate_m,
            "{fault}: {} m, {} m without",
            outcome.ate_m,
            clean.ate_m
        );
        assert_counted(fault, &clean, outcome);
    }
}

/// `gyre-lab corrupt`.
fn corrupt(data: &Path, fault: &str, every: usize, out: &Path) -> Ended {
    let mut command = gyre_lab();
    command
        .arg("corrupt")
        .arg(data)
        .args(["--every", &every.to_string(), "--fault", fault, "--out"])
        .arg(out);
    Ended::of(command)
}

/// The folder of a corrupted copy of the small recording.
fn corrupted_small(folder: &Path, fault: &str) -> PathBuf {
    let out = folder.join(fault);
    let ended = corrupt(recording::small(), fault, 10, &out);
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
    let run = Run::small().data(&corrupted_small(folder.path(), "dropped"));
    let rows = odometry::rows(&run.complete());
    assert_eq!(rows.len(), recording::SCANS - 1 - 2);
    odometry::assert_unbroken(&rows);
    assert_eq!(run.summary()["missing"], 2);
}

#[test]
fn a_corrupted_scan_is_a_scan_all_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let run = Run::small().data(&corrupted_small(folder.path(), "noise"));
    assert_eq!(odometry::rows(&run.complete()).len(), recording::SCANS - 1);
    assert_eq!(
        (&run.summary()["missing"], &run.summary()["unreadable"]),
        (&Value::from(0), &Value::from(0))
    );
}

#[test]
fn what_cannot_be_corrupted_is_refused_in_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let noise = |data: &Path, out: &str| corrupt(data, "noise", 20, &folder.path().join(out));
    noise(&folder.path().join("none"), "new").refused_with(&["none", "no such folder"]);
    corrupted_small(folder.path(), "turned");
    noise(recording::small(), "turned").refused_with(&["turned holds", "give an empty folder"]);
}
