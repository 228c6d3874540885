//! `gyre calibrate`: what it says of a recording, and that a run takes its file.

use std::{fs, path::Path};

use crate::common::{Ended, Run, gyre, recording};

/// Little to compare: as few scans as determine the constants, and points nearby.
const FEW: &str = "source.scans=60";
const NEAR: &str = "points.max_range_m=50";
/// By how much the recording is read with too long ranges, m.
const WRONG_BY_M: f64 = 0.25;

fn calibrate(recording: &Path, out: &Path, set: &[&str]) -> Ended {
    let mut command = gyre();
    command
        .arg("calibrate")
        .arg(recording)
        .arg("--out")
        .arg(out);
    for sentence in set {
        command.args(["--set", sentence]);
    }
    Ended::of(command)
}

/// The range offset of a `dataset.toml`, or of a section `[dataset]`.
fn range_offset_m(settings: &str) -> f64 {
    let table: toml::Table = settings.parse().unwrap();
    let dataset = table.get("dataset").and_then(|it| it.as_table());
    let offset_m = &dataset.unwrap_or(&table)["range_offset_m"];
    offset_m.as_float().unwrap()
}

#[test]
fn a_wrong_range_offset_is_named_and_put_right_by_the_file() {
    let recording = recording::around_a_block();
    let out = tempfile::tempdir().unwrap();
    let right_m = range_offset_m(&fs::read_to_string(recording.join("dataset.toml")).unwrap());
    let wrong = format!("dataset.range_offset_m={}", right_m + WRONG_BY_M);
    let ended = calibrate(recording, out.path(), &[&wrong, FEW, NEAR]);
    let said = ended.succeeded().stdout.clone();
    let line = |name: &str| said.lines().find(|line| line.starts_with(name)).unwrap();
    assert!(
        line("range offset").ends_with("CONTRADICTS the configured value"),
        "{said}"
    );
    assert!(!line("Doppler shift").contains("CONTRADICTS"), "{said}");
    assert!(
        line("range resolution").contains("a drive alone cannot tell it"),
        "{said}"
    );
    let picture = fs::read_to_string(out.path().join("calibration.svg")).unwrap();
    assert!(picture.contains("as configured") && picture.contains("as proposed"));
    let overlap: Vec<f64> = said
        .lines()
        .last()
        .filter(|line| line.starts_with("overlap of the scans"))
        .map(|line| {
            line.split(' ')
                .filter_map(|word| word.parse().ok())
                .collect()
        })
        .unwrap();
    assert!(overlap.len() == 2 && overlap[1] > overlap[0], "{said}");

    let file = out.path().join("calibration.toml");
    let found_m = range_offset_m(&fs::read_to_string(&file).unwrap());
    assert!(
        (found_m - right_m).abs() < 0.1,
        "{found_m} m for {right_m} m"
    );
    let run = Run::of_recording_named(recording.to_str().unwrap())
        .set("source.scans=6")
        .argument("--calibration", file.to_str().unwrap());
    run.complete();
    let used_m = range_offset_m(&run.result("config.toml"));
    assert!(
        (used_m - found_m).abs() < 1e-6,
        "{used_m} m for {found_m} m"
    );
}

#[test]
fn a_drive_that_is_too_short_is_refused() {
    let out = tempfile::tempdir().unwrap();
    let ended = calibrate(recording::small(), out.path(), &["source.scans=3"]);
    ended.failed_with(&["scans"]);
    assert!(!out.path().join("calibration.toml").exists());
}
