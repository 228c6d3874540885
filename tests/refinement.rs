//! The sixth process: refinement between the search and the poses, and its death.

#![allow(clippy::unwrap_used)]

mod common;

use std::collections::BTreeSet;

use common::{Ended, Run, Running, STAGES, odometry, recording, send, undisturbed};
use rustix::process::Signal;
use serde_json::Value;

const REFINEMENT: &str = "refinement";
/// What the search says of a motion.
const SEARCHED: [&str; 5] = ["searched_x_m", "searched_y_m", "searched_yaw_rad", "score", "runner_up_score"];
/// The recording's six seconds in one.
const MODERATE: &str = "6";
const MIDDLE: usize = recording::SCANS / 3;

fn refining() -> Run {
    Run::of_recording().set("refinement.kind=local-map")
}

fn six_stages() -> BTreeSet<String> {
    STAGES.into_iter().chain([REFINEMENT]).map(str::to_owned).collect()
}

/// The same run again, disturbed once it is in its middle: the result is the same to the byte.
fn survives(undisturbed: &str, run: &Run, disturb: impl FnOnce(&mut Running)) {
    let mut running = run.start();
    running.await_poses(MIDDLE);
    disturb(&mut running);
    let ended = running.finish();
    ended.succeeded();
    assert_eq!(run.odometry(), undisturbed, "{}", ended.stderr);
    assert_eq!(run.summary()["published"], recording::SCANS);
}

fn restarted(run: &Run) -> BTreeSet<String> {
    run.summary()["restarts"].as_object().unwrap().keys().cloned().collect()
}

/// Columns of an `odometry.csv`, by their names.
fn columns(csv: &str, names: &[&str]) -> Vec<Vec<String>> {
    let header: Vec<&str> = csv.lines().next().unwrap().split(',').collect();
    let places: Vec<usize> = names.iter().map(|name| header.iter().position(|field| field == name).unwrap()).collect();
    let row = |line: &str| {
        let fields: Vec<&str> = line.split(',').collect();
        places.iter().map(|place| fields[*place].to_owned()).collect()
    };
    csv.lines().skip(1).map(row).collect()
}

#[test]
fn six_processes_give_each_motion_a_row_and_a_place_in_the_summary() {
    let run = refining();
    let rows = odometry::rows(&run.complete());
    assert_eq!(rows.len(), recording::SCANS - 1);
    odometry::assert_unbroken(&rows);
    let summary = run.summary();
    let names = |object: &Value| object.as_object().unwrap().keys().cloned().collect::<BTreeSet<_>>();
    assert_eq!(names(&summary["stages"]), six_stages());
    assert_eq!(names(&summary["latency"]["stages"]), six_stages());
    assert_eq!(summary["stages"][REFINEMENT]["allocations_after_five"], 0);
    let counts = BTreeSet::from(["refined", "weak", "predicted", "doubtful", "second_hypothesis"].map(str::to_owned));
    assert_eq!(names(&summary["motions"]), counts);
}

#[test]
fn a_run_that_does_not_refine_counts_no_refined_motions() {
    let run = Run::of_recording();
    run.complete();
    assert!(run.summary().get("motions").is_none());
}

#[test]
fn motions_that_are_passed_through_are_those_of_a_run_without() {
    assert_eq!(refining().complete(), undisturbed());
}

/// Masking undoes the sweep with searched motions, so the search sees the same rasters whether its motions are refined or not.
#[test]
fn refining_changes_nothing_for_the_search() {
    assert_eq!(columns(&refining().complete(), &SEARCHED), columns(undisturbed(), &SEARCHED));
    let motions = columns(undisturbed(), &["x_m", "y_m", "yaw_rad"]);
    assert_eq!(
        motions,
        columns(undisturbed(), &SEARCHED[..3]),
        "without a refinement, what was searched is the motion"
    );
}

#[test]
fn neither_window_nor_rate_changes_refined_motions() {
    let alone = refining().complete();
    for window in [1, 2, 8] {
        assert_eq!(refining().set(&format!("run.window={window}")).complete(), alone, "window {window}");
    }
    assert_eq!(refining().rate("12").complete(), alone);
}

#[test]
fn a_killed_refinement_is_started_again_alone() {
    let alone = refining().complete();
    let run = refining().rate(MODERATE);
    survives(&alone, &run, |running| {
        running.kill(REFINEMENT);
    });
    assert_eq!(restarted(&run), BTreeSet::from([REFINEMENT.to_owned()]));
}

#[test]
fn a_refinement_killed_again_after_each_few_poses_goes_on() {
    let alone = refining().complete();
    let run = refining().rate(MODERATE);
    survives(&alone, &run, |running| {
        for poses in [MIDDLE, MIDDLE + 4, MIDDLE + 8] {
            running.await_poses(poses).kill(REFINEMENT);
        }
    });
    assert_eq!(restarted(&run), BTreeSet::from([REFINEMENT.to_owned()]));
}

#[test]
fn refinement_and_a_neighbour_killed_at_once_go_on() {
    let alone = refining().complete();
    for neighbour in ["translation-search", "pose-integration", "masking"] {
        let run = refining().rate(MODERATE);
        survives(&alone, &run, |running| {
            running.kill(neighbour).kill(REFINEMENT);
        });
        assert_eq!(restarted(&run), BTreeSet::from([REFINEMENT, neighbour].map(str::to_owned)), "{neighbour}");
    }
}

#[test]
fn six_processes_killed_at_once_go_on() {
    let alone = refining().complete();
    let run = refining().rate(MODERATE);
    survives(&alone, &run, |running| {
        running.stages().values().for_each(|pid| send(*pid, Signal::KILL));
    });
    assert_eq!(restarted(&run), six_stages());
}

#[test]
fn an_interrupted_run_goes_on_refining() {
    let alone = refining().complete();
    let run = refining().rate(MODERATE);
    let mut running = run.start();
    running.await_poses(MIDDLE).signal(Signal::INT);
    assert_eq!(running.finish().code(), Some(130));
    assert_eq!(run.complete(), alone);
}

#[test]
fn an_unfinished_run_is_not_continued_with_another_refinement() {
    let run = refining().rate(MODERATE);
    let mut running = run.start();
    running.await_poses(MIDDLE).signal(Signal::INT);
    running.finish();
    let other = Run::of_recording().into(run.out());
    Ended::of(other.command()).refused_with(&["unfinished run of another configuration"]);
}

#[test]
fn joint_search_is_refined_as_well() {
    let run = refining().set("search.kind=exhaustive");
    let without = Run::of_recording().set("search.kind=exhaustive").complete();
    assert_eq!(columns(&run.complete(), &SEARCHED), columns(&without, &SEARCHED));
    assert_eq!(run.summary()["stages"].as_object().unwrap().len(), 5);
}
