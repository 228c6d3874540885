//! Bad input: one clear sentence and a failure before anything starts, or a scan that is skipped,
//! counted, and no more.

use std::{fs, path::Path};

use gyre_transport::run::SHARED_MEMORY;

use crate::{
    common::{Ended, Run, STAGES, odometry, recording, with_tmpfs},
    restart::faults::configurations,
};

/// A run of another folder than the recording's.
fn run_of(folder: &Path) -> Run {
    Run::small().data(folder)
}

/// The reasons themselves are tested where they are found: here, that the program prints one
/// sentence and starts nothing.
#[test]
fn what_a_run_cannot_use_is_refused_before_anything_starts() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scan.txt");
    fs::write(&file, "buy milk").unwrap();
    let (one, empty) = (recording::copy(1), recording::copy(3));
    for image in recording::images(empty.path()) {
        recording::truncate(&image, 0);
    }
    let refused = |run: Run, words: &[&str]| {
        run.finish().refused_with(words);
        assert!(!run.out().join("journal").exists(), "{words:?}");
    };
    refused(Run::configured(""), &["no dataset", "source.data"]);
    let nowhere = Path::new("/nowhere/at/all");
    refused(
        run_of(nowhere),
        &["/nowhere/at/all", "is no file or folder"],
    );
    let data = format!("source.data={}", file.display());
    refused(
        Run::configured("").set(&data),
        &["scan.txt is a file", "folder"],
    );
    let few = ["has 1 scan:", "a motion is between two"];
    refused(run_of(one.path()), &few);
    refused(run_of(empty.path()), &["first image", ".png"]);
    let away = Run::of_file(Path::new("no/such.toml"));
    refused(away, &["no/such.toml", "No such file"]);
    let unwritable = Run::of_recording().into(&file.join("out"));
    refused(unwritable, &["cannot write to", "scan.txt/out"]);
    let late = configurations::gyro_and_wheels().run();
    let late = late.set("wheels.delay_s=600");
    refused(late, &["the log of the wheels", "wheels.delay_s is wrong"]);
    // Settings, and words of the refusal.
    for case in [
        "source.first=24|source.first is 24|24 scans, from 0 to 23",
        "masking.treshold=3|[masking]|did you mean `threshold`?",
        "masking.kind=learned|masking.model does not name a model",
        "doppler.kind=auto|which azimuths|doppler.kind",
        "gyro.kind=auto|no log of a gyro lies beside the scans|gyro.kind",
        "slam.kind=graph gnss.kind=auto|no log of a GNSS receiver lies beside",
        "slam.kind=graph gnss.kind=log gnss.file=nowhere.csv|nowhere.csv",
        "slam.kind=graph slam.map='nowhere'|nowhere is not a map",
    ] {
        let (settings, words) = case.split_once('|').unwrap();
        let run = Run::of_recording().sets(settings);
        refused(run, &words.split('|').collect::<Vec<_>>());
    }
}

#[test]
fn a_dataset_of_truncated_images_alone_is_reported() {
    let recording = recording::copy(3);
    for image in recording::images(recording.path()) {
        recording::truncate(&image, 5000);
    }
    let ended = run_of(recording.path()).finish();
    ended.failed_with(&["only 0 of the 3 scans", "log.jsonl"]);
}

// A bad scan among good ones.

/// Damages scan `bad` of eight, and asserts that no other scan is left out.
fn skips(bad: usize, reason: &str, damage: impl FnOnce(&Path)) {
    let recording = recording::copy(8);
    damage(&recording::images(recording.path())[bad]);
    let run = run_of(recording.path());
    run.finish().succeeded();
    run.assert_counts("published=7 processed=7 unreadable=1 dropped=0 breaks=0");
    let rows = odometry::rows(&run.odometry());
    odometry::assert_unbroken(&rows);
    assert_eq!(rows.len(), 6);
    assert!(rows.iter().all(|row| row.scan != bad as u64), "{rows:?}");
    let log = run.result("log.jsonl");
    let is_reported = |line: &&str| line.contains("WARN") && line.contains(reason);
    assert_eq!(log.lines().filter(is_reported).count(), 1, "{log}");
}

#[test]
fn a_scan_that_cannot_be_used_is_skipped_wherever_it_is() {
    for bad in [0, 4, 7] {
        let truncate = |image: &Path| recording::truncate(image, 100_000);
        skips(bad, "truncated", truncate);
    }
}

// The machine.

#[test]
fn a_stage_command_that_does_not_exist_is_reported() {
    for stage in STAGES {
        let command = format!("stages.{stage}.command=['/no/such/program', 'x']");
        let ended = Run::of_recording().set(&command).finish();
        ended.failed_with(&["cannot start", stage, "/no/such/program x", "No such file"]);
    }
}

#[test]
fn an_unknown_stage_and_a_stage_without_a_run_are_reported() {
    let stage = |name| {
        let mut command = crate::common::gyre();
        command.args(["stage", name]).env_remove("GYRE_RUN");
        Ended::of(command)
    };
    stage("maskin").refused_with(&["`maskin`", "masking"]);
    let ended = stage("masking");
    assert_eq!(ended.code(), Some(2));
    let said = &ended.stderr;
    assert!(
        said.lines().count() == 1 && said.contains("gyre run"),
        "{said}"
    );
}

#[test]
fn too_little_shared_memory_is_reported_with_the_need_and_just_enough_suffices() {
    let run = Run::of_recording();
    let with = |options: &str| with_tmpfs(&run.command(), Path::new(SHARED_MEMORY), options);
    let Some(small) = with("size=1m") else {
        return;
    };
    let ended = run.start_as(small).finish();
    ended.refused_with(&[
        "/dev/shm has 1.0 MB free",
        "the run needs",
        "MB of shared memory",
        "--shm-size",
    ]);
    assert!(!run.out().join("journal").exists(), "before the first scan");
    let read_only = run.start_as(with("ro,size=1g").unwrap()).finish();
    read_only.refused_with(&["/dev/shm", "writable tmpfs"]);
    let (_, needed) = ended.stderr.split_once("needs ").unwrap();
    let needed: f64 = needed.split(' ').next().unwrap().parse().unwrap();
    let size = format!("size={}k", (needed * 1e6 / 1024.0) as u64 + 200);
    run.start_as(with(&size).unwrap()).finish().succeeded();
}
