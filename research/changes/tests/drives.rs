//! `gyre-changes EARLIER LATER`: what has appeared and gone between two drives through one town.

use std::{fs, path::Path};

use gyre_worlds::{Profile, SimulationConfig, write_dataset};
use serde_json::Value;

use crate::common::{Ended, Run, gyre, recording};
use crate::gyre_changes;

/// The method's configuration.
const METHOD: &str = "[raster]\nn = 255\ncell_m = 0.4\n";

/// A drive around a block of the town with this seed, with traffic and noise of its own, and with
/// other parked cars than the town's own if `changes` says so.
fn drive(town: u64, seed: u64, changes: Option<u64>) -> Run {
    let mut config = SimulationConfig {
        seed,
        scans: Some(50),
        ..SimulationConfig::default()
    };
    config.town.seed = Some(town);
    config.town.changes_seed = changes;
    config.sensor.profile = Profile::Cts350xRadiate;
    let data = recording::prepared(&format!("town-{town}-{seed}"), |folder| {
        write_dataset(&config, folder, &mut |_, _| ()).unwrap();
    });
    let run = Run::configured(METHOD).data(&data).set("slam.kind=graph");
    run.complete();
    run
}

fn compare(earlier: &Path, later: &Run, out: &Path, options: &[&str]) -> Ended {
    let mut command = gyre_changes();
    command.arg(earlier).arg(later.out());
    command.arg("--out").arg(out).args(options);
    Ended::of(command)
}

fn count(report: &Value, kind: &str) -> u64 {
    report[kind].as_u64().unwrap()
}

#[test]
fn parked_cars_that_have_come_and_gone_are_reported_and_a_drive_has_not_changed_since_itself() {
    let (first, second) = (drive(3, 1, None), drive(3, 9, Some(5)));
    let out = second.folder().join("changes");
    let ended = compare(first.out(), &second, &out, &["--json"]);
    ended.succeeded();
    let report: Value = serde_json::from_str(&ended.stdout).unwrap();
    let counts = ["appeared", "gone"].map(|kind| count(&report, kind));
    assert!(counts.iter().all(|it| *it > 0), "{counts:?}");
    let table = fs::read_to_string(out.join("changes.csv")).unwrap();
    let mut rows = table.lines();
    assert_eq!(
        rows.next(),
        Some("change,kind,x_m,y_m,yaw_rad,length_m,width_m,confidence")
    );
    assert_eq!(rows.count() as u64, counts[0] + counts[1]);

    // The folder of a map stands for its run.
    let map = first.folder().join("map");
    let mut draw = gyre();
    draw.arg("map").arg(first.out()).arg("--out").arg(&map);
    Ended::of(draw).succeeded();
    let ended = compare(&map, &second, &second.folder().join("again"), &["--json"]);
    ended.succeeded();
    let again: Value = serde_json::from_str(&ended.stdout).unwrap();
    assert_eq!(again["changes"], report["changes"]);

    let ended = compare(first.out(), &first, &first.folder().join("none"), &[]);
    ended.succeeded();
    assert!(
        ended
            .stdout
            .starts_with("0 things have appeared and 0 have gone"),
        "{}",
        ended.stdout
    );
}

#[test]
fn a_drive_that_cannot_be_compared_is_refused() {
    let first = drive(3, 1, None);
    let plain = Run::configured(&format!("{METHOD}[simulation]\nscans = 4\n"));
    plain.complete();
    let out = first.folder().join("changes");
    let hint = ["keyframes.log does not exist", "--set slam.kind=graph"];
    compare(first.out(), &plain, &out, &[]).refused_with(&hint);
    compare(plain.out(), &first, &out, &[]).refused_with(&hint);
    compare(Path::new("nowhere"), &first, &out, &[]).refused_with(&["nowhere is not a map"]);
    assert!(!out.exists());
}

#[test]
fn drives_through_two_towns_are_refused() {
    let (first, elsewhere) = (drive(3, 1, None), drive(5, 9, None));
    let out = elsewhere.folder().join("changes");
    let ended = compare(first.out(), &elsewhere, &out, &[]);
    ended.refused_with(&["no keyframe of", "the drives have no place in common"]);
    assert!(!out.exists());
}
