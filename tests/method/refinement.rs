//! Refinement, the process between the search and the poses: what it changes, what it leaves alone,
//! and its death while it writes its map.

use std::{collections::BTreeSet, fs, thread, time::Duration};

use crate::common::{
    Ended, Pid, Run, Running, STAGES, odometry::columns, recording, send, undisturbed,
};
use gyre_journal::{self as journal, Journal};
use rustix::process::Signal;
use serde_json::Value;

const REFINEMENT: &str = "refinement";
const MAP: &str = "journal/refinement.map";
/// The searched part of a row.
const SEARCHED: [&str; 5] = [
    "searched_x_m",
    "searched_y_m",
    "searched_yaw_rad",
    "score",
    "runner_up_score",
];
const MOTION: [&str; 3] = ["x_m", "y_m", "yaw_rad"];
/// The recording's six seconds in one.
const MODERATE: &str = "6";
const MIDDLE: usize = recording::SCANS / 3;

fn without() -> Run {
    Run::of_recording().set("refinement.kind=none")
}

/// A map so small that its keyframes' slots are used again within the recording.
fn with_small_map() -> Run {
    Run::of_recording()
        .set("refinement.keyframes=2")
        .set("run.window=1")
}

fn names(object: &Value) -> BTreeSet<String> {
    object.as_object().unwrap().keys().cloned().collect()
}

// What it changes.

#[test]
fn each_motion_is_counted_by_how_its_refinement_ended() {
    let run = Run::of_recording();
    let outcomes: Vec<String> = columns(&run.complete(), &["outcome"]).concat();
    let summary = run.summary();
    assert_eq!(
        names(&summary["stages"]),
        BTreeSet::from(STAGES.map(str::to_owned))
    );
    assert_eq!(
        names(&summary["latency"]["stages"]),
        BTreeSet::from(STAGES.map(str::to_owned))
    );
    let motions = &summary["motions"];
    for outcome in ["refined", "weak", "predicted"] {
        assert_eq!(
            motions[outcome],
            outcomes.iter().filter(|word| *word == outcome).count(),
            "{outcome}"
        );
    }
    assert!(
        motions["refined"].as_u64().unwrap() > recording::SCANS as u64 / 2,
        "{motions}"
    );
    assert_eq!(outcomes.len(), recording::SCANS - 1);
}

#[test]
fn a_run_that_does_not_refine_has_neither_the_process_nor_its_map_nor_its_counts() {
    let run = without();
    let odometry = run.complete();
    let summary = run.summary();
    assert!(summary.get("motions").is_none());
    assert!(!names(&summary["stages"]).contains(REFINEMENT));
    assert!(!run.out().join(MAP).exists());
    assert_eq!(
        columns(&odometry, &MOTION),
        columns(&odometry, &SEARCHED[..3]),
        "what was searched is the motion"
    );
    assert!(
        columns(&odometry, &["outcome"])
            .concat()
            .iter()
            .all(|outcome| outcome == "searched")
    );
}

/// Masking compensates with searched motions, so the search sees the same rasters whether its
/// motions are refined or not.
#[test]
fn refining_changes_nothing_for_the_search() {
    let alone = without().complete();
    assert_eq!(
        columns(undisturbed(), &SEARCHED),
        columns(&alone, &SEARCHED)
    );
    assert_ne!(columns(undisturbed(), &MOTION), columns(&alone, &MOTION));
}

#[test]
fn refined_motions_are_nearer_to_the_truth() {
    let error = |run: Run| {
        run.complete();
        run.summary()["evaluation"]["ate"]["rmse_m"]
            .as_f64()
            .unwrap()
    };
    let (refined, searched) = (error(Run::of_recording()), error(without()));
    assert!(
        refined < searched,
        "{refined} m refined, {searched} m as searched"
    );
}

#[test]
fn joint_search_is_refined_as_well() {
    let run = Run::of_recording().set("search.kind=exhaustive");
    let without = without().set("search.kind=exhaustive").complete();
    assert_eq!(
        columns(&run.complete(), &SEARCHED),
        columns(&without, &SEARCHED)
    );
    assert_eq!(
        run.summary()["stages"].as_object().unwrap().len(),
        STAGES.len() - 1
    );
}

// Its death.

/// The run is disturbed once it is in its middle: the result is that of one that was not, to the
/// byte.
fn survives(run: &Run, undisturbed: &str, disturb: impl FnOnce(&mut Running)) {
    let run = run.clone().rate(MODERATE);
    let mut running = run.start();
    running.await_poses(MIDDLE);
    disturb(&mut running);
    let ended = running.finish();
    ended.succeeded();
    assert_eq!(run.odometry(), undisturbed, "{}", ended.stderr);
    assert_eq!(run.summary()["published"], recording::SCANS);
}

#[test]
fn refinement_and_a_neighbour_killed_at_once_go_on() {
    for neighbour in ["translation-search", "pose-integration", "masking"] {
        let run = Run::of_recording();
        survives(&run, undisturbed(), |running| {
            running.kill(neighbour).kill(REFINEMENT);
        });
        assert_eq!(
            names(&run.summary()["restarts"]),
            BTreeSet::from([REFINEMENT, neighbour].map(str::to_owned))
        );
    }
}

/// The recording's vehicle makes nearly every scan a keyframe, so deaths this dense meet keyframes
/// and states half written.
#[test]
#[ignore = "nightly: kills at many moments"]
fn refinement_killed_at_any_moment_of_many_lives_goes_on() {
    for run in [Run::of_recording(), with_small_map()] {
        let alone = run.clone().into(&run.folder().join("alone")).complete();
        let run = run.set("stages.refinement.restart.limit=1000");
        survives(&run, &alone, |running| {
            let mut last: Pid = 0;
            for delay_us in (0..16).map(|k| 2_500 * k) {
                last = running.await_other_stage(REFINEMENT, last);
                thread::sleep(Duration::from_micros(delay_us));
                send(last, Signal::KILL);
            }
        });
        assert!(
            run.summary()["restarts"][REFINEMENT].as_u64().unwrap() > 3,
            "{}",
            run.summary()["restarts"]
        );
    }
}

#[test]
#[ignore = "nightly: kills at many moments"]
fn refinement_killed_after_each_pose_goes_on() {
    let run = with_small_map();
    let alone = run.clone().into(&run.folder().join("alone")).complete();
    let run = run.rate("3").set("stages.refinement.restart.limit=1000");
    let mut running = run.start();
    for poses in 1..recording::SCANS {
        running.await_poses_or_end(poses);
        if let Some(pid) = running.stages().get(REFINEMENT) {
            send(*pid, Signal::KILL);
        }
    }
    let ended = running.finish();
    ended.succeeded();
    assert_eq!(run.odometry(), alone, "{}", ended.stderr);
}

#[test]
#[ignore = "nightly: kills at many moments"]
fn a_supervisor_killed_again_and_again_does_not_confuse_the_map() {
    let run = with_small_map();
    let alone = run.clone().into(&run.folder().join("alone")).complete();
    let slowly = run.clone().rate(MODERATE);
    for poses in [1, 2, 7, 8, 15, 20] {
        let mut running = slowly.start();
        running.await_poses(poses);
        running.kill_supervisor();
    }
    assert_eq!(run.complete(), alone);
}

// Its map.

/// Interrupts a run in its middle.
fn interrupted() -> Run {
    let run = Run::of_recording();
    let mut running = run.clone().rate(MODERATE).start();
    running.await_poses(MIDDLE).signal(Signal::INT);
    assert_eq!(running.finish().code(), Some(130));
    run
}

#[test]
fn an_unfinished_run_is_not_continued_with_another_refinement() {
    let run = interrupted();
    for other in [without(), Run::of_recording().set("refinement.keyframes=3")] {
        Ended::of(other.into(run.out()).command())
            .refused_with(&["unfinished run of another configuration"]);
    }
}

/// Returns what damage can leave of a map.
fn damages(whole: &[u8]) -> [Vec<u8>; 4] {
    let flip = |(k, byte): (usize, &u8)| if k > 100 { !byte } else { *byte };
    let flipped = whole.iter().enumerate().map(flip).collect();
    [
        Vec::new(),
        whole[..100].to_vec(),
        b"not a map".to_vec(),
        flipped,
    ]
}

/// Appends poses to the journal that the map does not know, as a power failure can leave them.
fn append_unknown_poses(run: &Run, poses: u64) {
    let mut journal = Journal::open(&journal::path(run.out())).unwrap();
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
    for k in 0..4 {
        let run = interrupted();
        let map = run.out().join(MAP);
        let damaged = &damages(&fs::read(&map).unwrap())[k];
        fs::write(&map, damaged).unwrap();
        let ended = run.finish();
        ended.succeeded();
        assert!(
            ended.stderr.contains("knows none of the"),
            "{}",
            ended.stderr
        );
        assert_eq!(run.odometry(), undisturbed());
    }
}

#[test]
fn a_lost_or_damaged_map_is_reported_and_the_run_can_be_started_anew() {
    let run = interrupted();
    append_unknown_poses(&run, 64);
    let map = run.out().join(MAP);
    for damaged in damages(&fs::read(&map).unwrap()) {
        fs::write(&map, damaged).unwrap();
        run.finish().refused_with(&[
            "refinement.map",
            "does not have the state of the refinement",
            "--fresh",
        ]);
    }
    assert_eq!(run.option("--fresh").complete(), undisturbed());
}

#[test]
fn poses_that_the_map_does_not_know_are_cut_off_and_computed_anew() {
    let run = interrupted();
    append_unknown_poses(&run, 70);
    let ended = run.finish();
    ended.succeeded();
    assert!(
        ended
            .stderr
            .contains("a power failure took the last 70 poses"),
        "{}",
        ended.stderr
    );
    assert_eq!(run.odometry(), undisturbed());
    assert!(run.summary()["resumed_after"].as_u64().unwrap() >= MIDDLE as u64);
}
