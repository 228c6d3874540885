//! `gyre calibrate`: its findings in a recording, and a run with its file.

use std::{fs, os::unix::fs::symlink, path::Path};

use tempfile::TempDir;

use crate::common::{Ended, Run, gyre, real_data, recording};

/// Little to compare: as few scans as determine the constants, and points nearby.
const FEW: &str = "source.scans=60";
const NEAR: &str = "points.max_range_m=50";
/// By how much the recording is read with too long ranges, m.
const WRONG_BY_M: f64 = 0.4;

fn calibrate(recording: &Path, out: &Path, set: &[&str], words: &[&str]) -> Ended {
    let mut command = gyre();
    command.arg("calibrate").arg(recording);
    command.arg("--out").arg(out).args(words);
    for sentence in set {
        command.args(["--set", sentence]);
    }
    Ended::of(command)
}

/// Reads a drive with too long ranges; returns the output, and the right offset.
fn wrongly_read(out: &Path, words: &[&str]) -> (String, f64) {
    let recording = recording::around_a_block();
    let right_m = range_offset_m(&fs::read_to_string(recording.join("dataset.toml")).unwrap());
    let wrong = format!("dataset.range_offset_m={}", right_m + WRONG_BY_M);
    let ended = calibrate(recording, out, &[&wrong, FEW, NEAR], words);
    (ended.succeeded().stdout.clone(), right_m)
}

/// The resolved configuration of a short run with a calibration.
fn configuration_with(file: &Path, recording: &Path) -> String {
    let run = Run::small().data(recording).set("source.scans=6");
    let run = run.argument("--calibration", file.to_str().unwrap());
    run.complete();
    run.result("config.toml")
}

/// The range offset of a `dataset.toml`, or of a section `[dataset]`.
fn range_offset_m(settings: &str) -> f64 {
    let table: toml::Table = settings.parse().unwrap();
    let dataset = table.get("dataset").and_then(|it| it.as_table());
    let offset_m = &dataset.unwrap_or(&table)["range_offset_m"];
    offset_m.as_float().unwrap()
}

#[test]
#[ignore = ".ci/nightly: calibrates a drive"]
fn a_wrong_range_offset_is_named_and_put_right_by_the_file() {
    let recording = recording::around_a_block();
    let out = tempfile::tempdir().unwrap();
    let (said, right_m) = wrongly_read(out.path(), &[]);
    let line = |name: &str| said.lines().find(|line| line.starts_with(name)).unwrap();
    let contradicts = line("range offset").ends_with("CONTRADICTS the configured value");
    assert!(contradicts, "{said}");
    let alone = "a drive alone cannot determine it";
    assert!(line("range resolution").contains(alone), "{said}");
    assert!(!line("Doppler shift").contains("CONTRADICTS"), "{said}");
    let words = line("parts of the scans").split([' ', ',']);
    let differ: Vec<f64> = words.filter_map(|word| word.parse().ok()).collect();
    assert!(differ.len() == 2 && differ[1] < differ[0], "{said}");

    let file = out.path().join("calibration.toml");
    let found_m = range_offset_m(&fs::read_to_string(&file).unwrap());
    assert!((found_m - right_m).abs() < 0.1, "{found_m}, {right_m}");
    let used_m = range_offset_m(&configuration_with(&file, recording));
    assert!((used_m - found_m).abs() < 1e-6, "{used_m}, {found_m}");
}

/// The offset and its standard deviation in the line of a drive or of all together.
fn offset_of(block: &str) -> [f64; 2] {
    let line = block.lines().find(|line| line.starts_with("range offset"));
    let words = line.unwrap().split_whitespace();
    let figures: Vec<f64> = words.filter_map(|word| word.parse().ok()).collect();
    [figures[0], figures[1]]
}

#[test]
#[ignore = ".ci/nightly: calibrates two drives"]
fn two_drives_determine_a_radar_better_than_one() {
    let recording = recording::around_a_block();
    let out = tempfile::tempdir().unwrap();
    let with = ["--with", recording.to_str().unwrap()];
    let (said, _) = wrongly_read(out.path(), &with);
    let (each, together) = said.split_once("all together: ").unwrap();
    let [alone, both] = [each, together].map(offset_of);
    assert!((both[0] - alone[0]).abs() < 1e-3, "{said}");
    assert!((both[1] - alone[1] / 2f64.sqrt()).abs() < 1e-3, "{said}");
    let file = fs::read_to_string(out.path().join("calibration.toml")).unwrap();
    assert!((range_offset_m(&file) - both[0]).abs() < 1e-3, "{file}");
}

#[test]
fn drives_that_are_read_with_different_constants_are_refused() {
    let (recording, out) = (recording::small(), tempfile::tempdir().unwrap());
    let other = recording::linked(recording, |number| number < 2);
    let settings = other.path().join("dataset.toml");
    let offset_m = range_offset_m(&fs::read_to_string(&settings).unwrap());
    let said = fs::read_to_string(&settings).unwrap();
    let key = format!("range_offset_m = {offset_m}");
    let changed = said.replace(&key, "range_offset_m = -0.4");
    assert_ne!(said, changed);
    fs::remove_file(&settings).unwrap();
    fs::write(&settings, changed).unwrap();
    let with = ["--with", other.path().to_str().unwrap()];
    calibrate(recording, out.path(), &["source.scans=2"], &with)
        .failed_with(&["range_offset_m", "with -0.4, which is not one radar"]);
}

#[test]
fn a_drive_that_is_too_short_is_refused() {
    let out = tempfile::tempdir().unwrap();
    calibrate(recording::small(), out.path(), &["source.scans=3"], &[]).failed_with(&["scans"]);
    assert!(!out.path().join("calibration.toml").exists());
}

/// The three-point turn of a real drive: it determines the delay of its gyro, and is too short for
/// the constants of the radar.
fn turning() -> Option<TempDir> {
    let (drive, part) = (real_data("radiate-2019-02-12")?, TempDir::new().unwrap());
    let images = |of: &Path| of.join("Navtech_Polar");
    fs::create_dir(images(part.path())).unwrap();
    for number in 437..537 {
        let name = format!("{number:06}.png");
        symlink(images(&drive).join(&name), images(part.path()).join(name)).unwrap();
    }
    for file in ["Navtech_Polar.txt", "imu_as_logged.csv"] {
        fs::copy(drive.join(file), part.path().join(file)).unwrap();
    }
    Some(part)
}

#[test]
fn the_clock_and_the_axis_of_a_gyro_are_found_and_a_run_takes_them() {
    let Some(recording) = turning() else { return };
    let (recording, out) = (recording.path(), TempDir::new().unwrap());
    let ended = calibrate(recording, out.path(), &[], &["radiate"]);
    ended.succeeded().prints("gyro, axis up         -z\n");
    let file = out.path().join("calibration.toml");
    let table: toml::Table = fs::read_to_string(&file).unwrap().parse().unwrap();
    let gyro = table["gyro"].as_table().unwrap();
    let delay_s = gyro["delay_s"].as_float().unwrap();
    assert!((delay_s - 1.58).abs() < 0.06, "{ended:?}");
    assert_eq!(gyro["kind"].as_str(), Some("auto"));
    let used: toml::Table = configuration_with(&file, recording).parse().unwrap();
    assert_eq!(used["gyro"]["delay_s"].as_float(), Some(delay_s));
    assert_eq!(used["gyro"]["up"].as_str(), Some("-z"));
}
