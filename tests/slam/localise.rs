//! `gyre localise` as a whole: a run is mapped, and other drives are found in its map, or are not.

use std::{fs, os::unix::fs::MetadataExt, path::Path, process::Stdio};

use gyre_geometry::Pose;
use gyre_radar::read_trajectory;

use crate::common::{Ended, Run, folder, gyre};

/// A drive around a block of the town with this seed, with traffic and noise of its own.
const DRIVE: &str = "[simulation]\n[raster]\nn = 255\ncell_m = 0.4\n";

/// Runs a drive, and draws its map into the run's folder.
fn mapped() -> Run {
    let run = Run::configured(DRIVE)
        .set("simulation.town.seed=3")
        .set("slam.kind=graph");
    run.complete();
    let mut map = gyre();
    map.arg("map")
        .arg(run.out())
        .args(["--format=folder", "--out"]);
    map.arg(run.folder().join("map"));
    Ended::of(map).succeeded();
    run
}

/// Localises a drive of another day in the town with the seed `town`, in the map of `run`.
fn localise(run: &Run, town: u64, out: &Path) -> Ended {
    let configuration = out.with_extension("toml");
    fs::write(&configuration, DRIVE).unwrap();
    let mut command = gyre();
    command.arg("localise").arg(configuration).arg("--map");
    command.arg(run.folder().join("map")).arg("--out").arg(out);
    for sentence in [
        format!("simulation.town.seed={town}"),
        "simulation.town.changes_seed=5".to_owned(),
        "simulation.seed=9".to_owned(),
        "simulation.weather=[{ rain_mm_h = 10.0 }]".to_owned(),
    ] {
        command.args(["--set", &sentence]);
    }
    Ended::of(command)
}

/// The time, the status and the place of each row of `fixes.csv`.
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
fn a_drive_on_another_day_is_found_in_the_map_of_a_run() {
    let (run, folder) = (mapped(), folder());
    let out = folder.path().join("found");
    let ended = localise(&run, 3, &out);
    ended.succeeded();
    assert!(
        ended.stdout.starts_with("first fix: scan 0"),
        "{}",
        ended.stdout
    );
    let truth = read_trajectory(&run.out().join("ground_truth.tum")).unwrap();
    let first = truth.poses[0];
    let rows = rows(&out);
    assert_eq!(rows.len(), truth.poses.len());
    for (number, (_, status, place)) in rows.iter().enumerate() {
        assert!(
            status == "found" || status == "tracked",
            "{number}: {status}"
        );
        // Both drives are of one path at one pace; the map's frame is that of its first scan.
        let expected = first.inv_mul(&truth.poses[number]);
        let error = expected.inv_mul(&place.unwrap());
        let (error_m, error_rad) = (error.translation.vector.norm(), error.rotation.angle());
        assert!(error_m < 0.5 && error_rad.abs() < 0.02, "{number}: {error}");
    }
    let again = folder.path().join("again");
    localise(&run, 3, &again).succeeded();
    let bytes = |out: &Path| fs::read(out.join("fixes.csv")).unwrap();
    assert_eq!(bytes(&out), bytes(&again));
    // Its results are their user's alone, as those of a run.
    let map = run.folder().join("map");
    let fixes = out.join("fixes.csv");
    for file in [map.join("map.toml"), map.join("keyframes.log"), fixes] {
        let mode = fs::metadata(&file).unwrap().mode();
        assert_eq!(mode & 0o777, 0o600, "{}: {mode:o}", file.display());
    }
}

#[test]
fn a_drive_through_another_town_is_lost_and_gets_no_fix() {
    let (run, folder) = (mapped(), folder());
    let out = folder.path().join("lost");
    let ended = localise(&run, 4, &out);
    ended.succeeded();
    assert!(
        ended.stdout.starts_with("no scan was found in the map"),
        "{}",
        ended.stdout
    );
    assert!(
        rows(&out)
            .iter()
            .all(|(_, status, place)| status == "lost" && place.is_none())
    );
}

#[test]
fn a_run_that_names_a_map_publishes_the_places_of_its_keyframes() {
    let mapped = mapped();
    let map = mapped.folder().join("map");
    let run = Run::configured(DRIVE)
        .set("simulation.town.seed=3")
        .set("simulation.seed=9")
        .set("slam.kind=graph")
        .set(&format!("slam.map='{}'", map.display()))
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
    let plain = Run::configured(DRIVE)
        .set("simulation.town.seed=3")
        .set("simulation.seed=9");
    assert_eq!(run.odometry(), plain.complete());
}

#[test]
fn a_run_in_a_map_that_does_not_exist_is_refused_before_it_starts() {
    let run = Run::configured(DRIVE).set("slam.map='nowhere'");
    let refused = run.clone().set("slam.kind=graph").finish();
    refused.refused_with(&["nowhere is not a map"]);
    run.finish()
        .refused_with(&["[slam]: map is set", "`graph`"]);
}

#[test]
fn a_folder_that_is_no_map_to_localise_in_is_refused_with_what_to_do() {
    let (run, folder) = (mapped(), folder());
    let out = folder.path().join("refused");
    fs::remove_file(run.folder().join("map/keyframes.log")).unwrap();
    localise(&run, 3, &out).refused_with(&[
        "keyframes.log has 0 keyframes and no end",
        "draw the map again with gyre map",
    ]);
    fs::remove_file(run.folder().join("map/map.toml")).unwrap();
    localise(&run, 3, &out).refused_with(&["is not a map", "map.toml"]);
    assert!(!out.exists());
}
