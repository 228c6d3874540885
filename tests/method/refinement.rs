//! Refinement, the process between the search and the poses: changed motions, unchanged motions,
//! and damage of its map.

use std::{collections::BTreeSet, fs};

use crate::{
    common::{
        Run, STAGES,
        odometry::columns,
        recording::{self, MIDDLE},
        undisturbed,
    },
    live::radar::{Radar, run_at},
    restart::results::interrupted,
};
use gyre_journal::Journal;
use serde_json::Value;

const REFINEMENT: &str = "refinement";
const MAP: &str = "journal/refinement.map";
const SEARCHED: [&str; 5] = [
    "searched_x_m",
    "searched_y_m",
    "searched_yaw_rad",
    "score",
    "runner_up_score",
];
const MOTION: [&str; 3] = ["x_m", "y_m", "yaw_rad"];

pub fn names(object: &Value) -> BTreeSet<String> {
    object.as_object().unwrap().keys().cloned().collect()
}

// What it changes.

#[test]
fn each_motion_is_counted_by_how_its_refinement_ended() {
    let run = Run::of_recording();
    let outcomes: Vec<String> = columns(&run.complete(), &["outcome"]).concat();
    let summary = run.summary();
    let stages = BTreeSet::from(STAGES.map(str::to_owned));
    assert_eq!(names(&summary["stages"]), stages);
    assert_eq!(names(&summary["latency"]["stages"]), stages);
    let motions = &summary["motions"];
    for outcome in ["refined", "weak", "predicted"] {
        let count = outcomes.iter().filter(|word| *word == outcome).count();
        assert_eq!(motions[outcome], count, "{outcome}");
    }
    let refined = motions["refined"].as_u64().unwrap();
    assert!(refined > recording::SCANS as u64 / 2, "{motions}");
    assert_eq!(outcomes.len(), recording::SCANS - 1);
}

/// Masking compensates with searched motions, so the search sees the same rasters whether its
/// motions are refined or not.
#[test]
fn a_run_that_does_not_refine_has_the_searched_motions_which_are_farther_from_the_truth() {
    let run = Run::of_recording().set("refinement.kind=none");
    let odometry = run.complete();
    let summary = run.summary();
    assert!(summary.get("motions").is_none());
    assert!(!names(&summary["stages"]).contains(REFINEMENT));
    assert!(!run.out().join(MAP).exists());
    let [motions, searched] = [&MOTION[..], &SEARCHED[..3]].map(|names| columns(&odometry, names));
    assert_eq!(motions, searched);
    let outcomes = columns(&odometry, &["outcome"]).concat();
    assert!(outcomes.iter().all(|outcome| outcome == "searched"));
    let refined = Run::of_recording();
    refined.complete();
    assert_eq!(
        columns(undisturbed(), &SEARCHED),
        columns(&odometry, &SEARCHED)
    );
    let [of_refined, of_searched] = [refined, run].map(|run| {
        let error_m = &run.summary()["evaluation"]["ate"]["rmse_m"];
        error_m.as_f64().unwrap()
    });
    assert!(of_refined < of_searched, "{of_refined} m, {of_searched} m");
}

// Its map.

/// Damages the map of a run. What damage leaves of a map is tested beside its reader.
fn damage(run: &Run) {
    let map = run.out().join(MAP);
    let whole = fs::read(&map).unwrap();
    fs::write(&map, &whole[..100]).unwrap();
}

/// Appends poses to the journal that the map does not know, as a power failure can leave them.
fn append_unknown_poses(run: &Run, poses: u64) {
    let mut journal = Journal::open(run.out()).unwrap();
    let (last, _) = journal.last(1).unwrap();
    for k in 1..=poses {
        let mut pose = last[0];
        pose.item.seq += k;
        pose.motion.x_m += k as f64;
        journal.append(&pose).unwrap();
    }
}

#[test]
fn a_map_that_was_lost_soon_after_the_start_lets_the_run_begin_anew() {
    let run = interrupted();
    damage(&run);
    run.finish().succeeded().says("knows none of the");
    assert_eq!(run.odometry(), undisturbed());

    let radar = Radar::playing(recording::small(), &["--repeat"]);
    let run = run_at(&radar.address).set("slam.kind=graph");
    run.started(3).interrupt();
    for lost in ["refinement.map", "keyframes.log"] {
        fs::remove_file(run.out().join("journal").join(lost)).unwrap();
    }
    let mut again = run.start();
    again.await_stages();
    again.interrupt().says("knows none of the");
}

#[test]
fn a_lost_or_damaged_map_is_reported_and_the_run_can_be_started_anew() {
    let run = interrupted();
    append_unknown_poses(&run, 64);
    damage(&run);
    run.finish().refused_with(&[
        "refinement.map",
        "does not have the state of the refinement",
        "--fresh",
    ]);
    assert_eq!(run.option("--fresh").complete(), undisturbed());
}

#[test]
fn poses_that_the_map_does_not_know_are_cut_off_and_computed_anew() {
    let run = interrupted();
    append_unknown_poses(&run, 70);
    let ended = run.finish();
    let words = "the last 70 poses of";
    ended.succeeded().says(words);
    assert_eq!(run.odometry(), undisturbed());
    assert!(run.count("resumed_after") >= MIDDLE as u64);
}
