//! `gyre localise` as a whole: a run is mapped, and other drives are found in its map.

use std::{
    fs,
    os::unix::fs::MetadataExt,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    sync::Arc,
};

use gyre_datasets::read_trajectory;
use gyre_geometry::Pose;
use serde_json::Value;

use crate::common::{Ended, Run, Shared, finished, folder, gyre, recording};

const CONFIGURATION: &str = "[raster]\nn = 255\ncell_m = 0.4\n";

/// Days of drives of one path at one pace.
#[derive(Debug)]
enum Day {
    First,
    Second,
    /// Other cars and other noise than on the second.
    Third,
}

fn first_drive() -> PathBuf {
    drive(Day::First)
}

fn drive(day: Day) -> PathBuf {
    let seed = match day {
        Day::First => "",
        Day::Second => "sensor.seed = 9\n",
        Day::Third => "sensor.seed = 10\n",
    };
    let settings = format!("{}seed = 3\n{seed}", recording::SENSOR);
    recording::configured(&format!("town-{day:?}"), &settings)
}

fn mapped() -> Arc<Run> {
    static RUN: Shared<Run> = Shared::new();
    RUN.get(|| {
        let run = Run::configured(CONFIGURATION)
            .data(&first_drive())
            .set("slam.kind=graph");
        run.complete();
        finished!["map", run.out(), "--format=folder", "--out", map_of(&run)].succeeded();
        run
    })
}

fn map_of(run: &Run) -> PathBuf {
    run.folder().join("map")
}

fn localising(map: &Path, drive: &Path, out: &Path) -> Command {
    let configuration = out.with_extension("toml");
    fs::write(&configuration, CONFIGURATION).unwrap();
    let mut command = gyre();
    command.arg("localise").arg(configuration).arg(drive);
    command.arg("--map").arg(map).arg("--out").arg(out);
    command
}

fn rows(out: &Path) -> Vec<(i64, String, Option<Pose>)> {
    let text = fs::read_to_string(out.join("fixes.csv")).unwrap();
    let row = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        assert_eq!(cells.len(), 14, "{line}");
        let number = |k: usize| cells[k].parse::<f64>().ok();
        let place =
            number(3).map(|x| gyre_geometry::pose(x, number(4).unwrap(), number(5).unwrap()));
        (cells[1].parse().unwrap(), cells[2].to_owned(), place)
    };
    text.lines().skip(1).map(row).collect()
}

#[test]
#[ignore = ".ci/nightly: two drives through a town"]
fn a_drive_on_another_day_is_found_in_the_map_of_a_run() {
    let (run, folder) = (mapped(), folder());
    let out = folder.path().join("found");
    let ended = Ended::of(localising(&map_of(&run), &drive(Day::Third), &out));
    let said = &ended.succeeded().stdout;
    assert!(said.starts_with("first fix: scan 0"), "{said}");
    let truth = read_trajectory(&first_drive().join("ground_truth.tum")).unwrap();
    let first = truth.poses[0];
    let rows = rows(&out);
    assert_eq!(rows.len(), truth.poses.len());
    for (number, (_, status, place)) in rows.iter().enumerate() {
        let has_fix = status == "found" || status == "tracked";
        assert!(has_fix, "{number}: {status}");
        // Both drives follow one path at one pace; the map's frame is the frame of its first scan,
        // and the map itself deviates from it by up to 0.61 m.
        let expected = first.inv_mul(&truth.poses[number]);
        let error = expected.inv_mul(&place.unwrap());
        let (error_m, error_rad) = (error.translation.vector.norm(), error.rotation.angle());
        assert!(error_m < 0.7 && error_rad.abs() < 0.02, "{number}: {error}");
    }
    let places = read_trajectory(&out.join("fixes.tum")).unwrap();
    let stamps_ns: Vec<i64> = rows.iter().map(|row| row.0).collect();
    assert_eq!(places.stamp_ns, Some(stamps_ns));
    for ((.., place), pose) in rows.iter().zip(&places.poses) {
        let apart = place.unwrap().inv_mul(pose);
        assert!(apart.translation.vector.norm() < 1e-3, "{apart}");
    }
    let picture = fs::read(out.join("fixes.png")).unwrap();
    assert!(picture.starts_with(b"\x89PNG"));
    let again = folder.path().join("again");
    let mut command = localising(&map_of(&run), &drive(Day::Third), &again);
    command.arg("--json");
    let ended = Ended::of(command);
    let figures: Value = serde_json::from_str(&ended.succeeded().stdout).unwrap();
    let count = |key: &str| figures[key].as_u64().unwrap();
    assert_eq!(count("found") + count("tracked"), rows.len() as u64);
    assert_eq!(figures["first_fix"], serde_json::json!([0, 0.0]));
    let bytes = |out: &Path| fs::read(out.join("fixes.csv")).unwrap();
    assert_eq!(bytes(&out), bytes(&again));
    // Only the user can read the results, as with a run.
    let map = map_of(&run);
    let fixes = out.join("fixes.csv");
    for file in [map.join("map.toml"), map.join("keyframes.log"), fixes] {
        let mode = fs::metadata(&file).unwrap().mode();
        assert_eq!(mode & 0o777, 0o600, "{}: {mode:o}", file.display());
    }
}

#[test]
#[ignore = ".ci/nightly: a drive in another town"]
fn a_drive_through_another_town_is_lost_and_gets_no_fix() {
    let (run, folder) = (mapped(), folder());
    let out = folder.path().join("lost");
    let settings = format!("{}seed = 4\n", recording::SENSOR);
    let elsewhere = recording::configured("other-town", &settings);
    let ended = Ended::of(localising(&map_of(&run), &elsewhere, &out));
    // The answer is no before all scans were looked for.
    let map = map_of(&run);
    let words = ["no scan of ", map.to_str().unwrap(), "40 others"];
    ended.failed_with(&words);
    ended.prints("no scan was found in the map");
    let rows = rows(&out);
    assert_eq!(rows.len(), 20);
    let is_lost =
        |(_, status, place): &(i64, String, Option<Pose>)| status == "lost" && place.is_none();
    assert!(rows.iter().all(is_lost), "{rows:?}");
}

#[test]
fn a_run_that_names_a_map_publishes_the_places_of_its_keyframes() {
    let mapped = mapped();
    let plain = Run::configured(CONFIGURATION).data(&drive(Day::Second));
    let map = map_of(&mapped);
    let run = plain
        .clone()
        .into(&plain.folder().join("mapped"))
        .sets(&format!("slam.kind=graph slam.map='{}'", map.display()))
        .rate("20");
    let mut running = run.start();
    running.await_stage("localisation");
    let mut watch = gyre();
    watch.arg("echo").arg(run.out()).arg("fix");
    let watch = watch.stdout(Stdio::piped()).spawn().unwrap();
    running.await_poses(30);
    running.kill("localisation");
    running.finish().succeeded();
    let watched = watch.wait_with_output().unwrap();
    let watched = String::from_utf8(watched.stdout).unwrap();
    let places = watched.lines().filter(|line| line.contains(" m, yaw "));
    assert!(places.count() > 10, "{watched}");
    assert!(!watched.contains("lost"), "{watched}");
    assert_eq!(run.odometry(), plain.complete());
}
