//! A replaced stage that sends what no stage may send: the stage that receives it refuses it by the
//! sender's name, and the poses before it are kept. That each stage refuses malformed messages of
//! each topic is a rule of [`conformance`](super::conformance).

use super::conformance::command;
use crate::common::{Run, recording};

/// The item that is sent wrong.
const FAULTY: u64 = 5;

#[test]
fn a_message_that_no_stage_may_send_is_refused_by_the_name_of_its_sender() {
    let script = format!("exec {}", command("sends NaN"));
    let run = Run::of_recording().stage_script("rotation-search", &script);
    let ended = run.finish();
    ended.failed_with(&["rotation-search", "angle_rad is NaN", "giving up"]);
    let odometry = run.odometry();
    assert!(!odometry.contains("NaN"), "{odometry}");
    let processed = run.summary()["processed"].as_u64();
    assert!(processed <= Some(FAULTY), "{processed:?}");
}

#[test]
fn a_message_that_does_not_come_again_costs_a_restart_and_no_pose() {
    let script = format!("exec {}", command("sends NaN once"));
    let run = Run::of_recording().stage_script("rotation-search", &script);
    // Its constant rotations may leave the run unsure.
    run.finish().does_not_say("giving up");
    assert!(run.out().join("asked").is_file());
    assert!(!run.odometry().contains("NaN"));
    let summary = run.summary();
    assert_eq!(summary["processed"], recording::SCANS);
    assert_ne!(summary["restarts"], serde_json::json!({}));
}
