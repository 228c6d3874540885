//! The follower that tracks objects: whatever happens to it, odometry does not notice, and it finds
//! the same objects to the byte.

use std::fs;

use gyre_messages::FollowerId;
use rustix::process::Signal;

use crate::common::{Ended, Run, gyre, recording::around_a_block};

const OBJECTS: &str = FollowerId::Objects.name();

fn tracking() -> Run {
    Run::small()
        .data(around_a_block())
        .set("objects.kind=tracks")
}

#[test]
#[ignore = "nightly: kills at many moments"]
fn a_killed_tracker_of_objects_finds_the_same_ones_and_odometry_does_not_depend_on_it() {
    let (plain, undisturbed) = (Run::small().data(around_a_block()), tracking());
    plain.complete();
    undisturbed.complete();
    assert!(undisturbed.odometry() == plain.odometry());
    assert!(!plain.out().join("objects.csv").exists());
    let objects = undisturbed.result("objects.csv");
    assert!(objects.lines().count() > 20, "{objects}");

    let run = tracking().rate("6");
    let mut running = run.start();
    running.await_stage(OBJECTS);
    for poses in [20, 60, 90] {
        running.await_poses(poses);
        running.kill(OBJECTS);
    }
    running.finish().succeeded();
    assert!(run.summary()["restarts"][OBJECTS].as_u64() >= Some(2));
    assert!(run.odometry() == undisturbed.odometry());
    assert!(run.result("objects.csv") == objects);
}

#[test]
#[ignore = "nightly: kills at many moments"]
fn objects_follow_a_run_that_is_interrupted_and_a_killed_pose_integration() {
    let undisturbed = tracking();
    undisturbed.complete();
    let run = tracking().rate("6");
    let mut running = run.start();
    running.await_poses(40);
    running.kill("pose-integration");
    running.await_poses(60).signal(Signal::INT);
    assert_eq!(running.finish().code(), Some(130));
    run.finish().succeeded();
    assert!(run.result("objects.csv") == undisturbed.result("objects.csv"));
    // The truth that is named must be that of the recording.
    let mut evaluation = gyre();
    evaluation
        .args(["evaluate", "--objects"])
        .arg(run.out())
        .arg(around_a_block());
    let printed = Ended::of(evaluation);
    printed.succeeded();
    assert!(printed.stdout.contains("precision"), "{}", printed.stdout);
    let empty = tempfile::tempdir().unwrap();
    fs::write(empty.path().join("objects.csv"), "").unwrap();
    let mut refused = gyre();
    refused
        .args(["evaluate", "--objects"])
        .arg(run.out())
        .arg(empty.path());
    Ended::of(refused).failed_with(&["ground_truth.tum"]);
}
