//! Stages that hang, do not start, or always die. That a killed stage changes no byte: see
//! [`faults`](super::faults).

use std::fs;

use crate::common::{Pid, Run, leftovers, odometry, recording, send, undisturbed};
use rustix::process::Signal;

/// The recording's six seconds in one.
const MODERATE: &str = "6";
const MIDDLE: usize = recording::SCANS / 3;

/// Stops a process as a replacement may hang that writes no heartbeat.
fn stop_without_a_heartbeat(run: &Run, name: &str, pid: Pid) {
    send(pid, Signal::STOP);
    let beat = format!("{name}.heartbeat");
    fs::remove_file(leftovers::root(run.out()).join(beat)).unwrap();
}

#[test]
fn a_stage_that_hangs_without_a_heartbeat_is_noticed_and_started_again() {
    for (stage, rate, words) in [
        ("rotation-search", MODERATE, "no pose for 2s"),
        ("radar-replay", MODERATE, "no scan from the source for 2s"),
        ("radar-replay", "max", "no scan from the source for 2s"),
    ] {
        let run = Run::of_recording().rate(rate).set("run.stall_timeout_s=2");
        let mut running = run.start();
        let pid = running.await_poses(3).await_stage(stage);
        stop_without_a_heartbeat(&run, stage, pid);
        let ended = running.finish();
        ended.succeeded();
        ended.says(words);
        assert_eq!(run.odometry(), undisturbed());
        assert_eq!(run.summary()["restarts"][stage], 1);
    }
}

#[test]
fn a_stage_that_takes_long_to_start_is_no_stall() {
    let run = Run::of_recording()
        .stage_script("masking", "sleep 4; exec {gyre} stage masking")
        .set("run.stall_timeout_s=1");
    let ended = run.finish();
    ended.succeeded();
    ended.does_not_say("restarted");
    assert_eq!(run.odometry(), undisturbed());
}

#[test]
fn a_stage_that_never_starts_ends_the_run_with_its_name() {
    let run = Run::of_recording()
        .stage_script("masking", "exec sleep 600")
        .set("run.start_timeout_s=0.5");
    run.finish().failed_with(&[
        "masking has not opened its topics within 500ms",
        "three times in a row",
    ]);
}

#[test]
fn a_stage_that_always_dies_ends_the_run_with_its_last_line_of_output() {
    let run = Run::of_recording()
        .stage_script("masking", "echo 'the mask is on fire' >&2; exit 7")
        .set("stages.masking.restart.limit=2");
    let ended = run.finish();
    ended.failed_with(&[
        "masking died 3 times",
        "exit code 7",
        "the mask is on fire",
        "giving up",
    ]);
    assert_eq!(ended.stderr.matches("restarted ").count(), 2);
}

#[test]
fn a_stage_that_would_fail_the_same_way_again_is_given_up_at_once() {
    let run = Run::of_recording().stage_script("masking", "echo 'masking: no licence' >&2; exit 2");
    let ended = run.finish();
    ended.failed_with(&["masking: no licence"]);
    ended.does_not_say("restarted ");
}

#[test]
fn what_was_computed_before_giving_up_is_kept_and_the_same_command_goes_on() {
    let run = Run::of_recording()
        .rate(MODERATE)
        .set("stages.masking.restart.limit=0");
    let mut running = run.start();
    running.await_poses(MIDDLE).kill("masking");
    let ended = running.finish();
    ended.failed_with(&[
        "masking died",
        "signal 9",
        "poses are kept",
        "the same command resumes",
    ]);
    assert!(odometry::rows(&run.odometry()).len() + 1 >= MIDDLE);
    assert_eq!(run.complete(), undisturbed());
}
