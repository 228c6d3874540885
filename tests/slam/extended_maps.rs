//! `gyre map --extend`: a second drive is placed in the map of a first one, or refused.

use std::path::{Path, PathBuf};

use gyre_datasets::read_trajectory;
use gyre_slam::localisation::Map;

use crate::common::{Ended, Run, finished};

fn drive(streets: u64, seed: u64) -> Run {
    let run = Run::configured("[simulation]\n[raster]\nn = 255\ncell_m = 0.4\n")
        .sets("simulation.sensor.profile=cts350x-radiate slam.kind=graph simulation.scans=40");
    run.sets(&format!(
        "simulation.seed={streets} simulation.sensor.seed={seed}"
    ))
}

/// Two thirds of the block.
fn first() -> (Run, PathBuf) {
    let run = drive(3, 1);
    run.complete();
    let map = run.folder().join("map");
    draw(&run, &map, &[]).succeeded();
    (run, map)
}

fn draw(run: &Run, out: &Path, options: &[&Path]) -> Ended {
    finished!["map", run.out(), "--out", out; options]
}

fn extend(run: &Run, map: &Path, out: &Path) -> Ended {
    draw(run, out, &[Path::new("--extend"), map])
}

#[test]
#[ignore = ".ci/nightly: two drives through the same streets"]
fn a_second_drive_is_placed_in_the_map_and_goes_on_beyond_it() {
    let (first, map) = first();
    // From half way round on, to the end of the block.
    let second = drive(3, 9).sets("simulation.scans=64 source.first=20");
    second.complete();
    let out = second.folder().join("map");
    extend(&second, &map, &out)
        .succeeded()
        .says("keyframes were found in");
    let [earlier, all] = [&map, &out].map(|folder| Map::open(folder).unwrap());
    let count = earlier.keyframes().len();
    for (kept, keyframe) in all.keyframes().iter().zip(earlier.keyframes()) {
        // A heading is stored as an angle, which loses the last bit of its cosine.
        let moved = kept.pose.motion.inv_mul(&keyframe.pose.motion);
        let is_there =
            moved.translation.vector.norm() < 1e-12 && moved.rotation.angle().abs() < 1e-12;
        let is_kept = is_there && kept.points == keyframe.points;
        assert!(is_kept, "scan {}", keyframe.scan);
    }
    let truth = |run: &Run| read_trajectory(&run.out().join("ground_truth.tum")).unwrap();
    // The map's frame is the frame of the first scan of the first drive.
    let (start, truth) = (truth(&first).poses[0], truth(&second));
    let added = &all.keyframes()[count..];
    assert!(added.len() > 20, "{}", added.len());
    for keyframe in added {
        let expected = start.inv_mul(&truth.near(keyframe.stamp_ns, 1_000).unwrap());
        let error = expected.inv_mul(&keyframe.pose.motion);
        let error_m = error.translation.vector.norm();
        let error_deg = error.rotation.angle().to_degrees();
        assert!(
            error_m < 0.5 && error_deg.abs() < 0.5,
            "scan {}: {error_m} m, {error_deg} deg",
            keyframe.scan
        );
    }
    let drawn = gyre_slam::mapping::Map::open(&out).unwrap();
    assert_eq!(drawn.keyframes(), all.keyframes().len());
    assert!(out.join("map.png").is_file());
    extend(&second, &out, &out).refused_with(&["--out is the map", "choose another folder"]);
    // A third one is placed in both.
    let again = second.folder().join("again");
    extend(&second, &out, &again).succeeded();
    let of_three = Map::open(&again).unwrap();
    let count = all.keyframes().len() + added.len();
    assert_eq!(of_three.keyframes().len(), count);
}

#[test]
#[ignore = ".ci/nightly: a drive in another town"]
fn a_drive_through_another_town_is_refused_and_the_map_is_kept() {
    let (_first, map) = first();
    let elsewhere = drive(5, 9);
    elsewhere.complete();
    let out = elsewhere.folder().join("map");
    extend(&elsewhere, &map, &out).refused_with(&["no keyframe of", "was found in the map"]);
    assert!(!out.exists());
    Map::open(&map).unwrap();
}
