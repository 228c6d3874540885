//! Stages that hang, do not start, or always die. That a killed stage changes no byte: see
//! [`faults`](super::faults).

use std::fs;

use crate::common::{Pid, Run, leftovers, recording::MODERATE, send, undisturbed};
use rustix::process::Signal;

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
        running.finish().succeeded().says(words);
        assert_eq!(run.odometry(), undisturbed());
        assert_eq!(run.summary()["restarts"][stage], 1);
    }
}

#[test]
fn a_stage_that_takes_long_to_start_is_no_stall() {
    let run = Run::of_recording()
        .stage_script("masking", "sleep 4; exec {gyre} stage masking")
        .set("run.stall_timeout_s=1");
    run.finish().succeeded().does_not_say("restarted");
    assert_eq!(run.odometry(), undisturbed());
}

#[test]
fn a_stage_that_cannot_work_is_given_up_and_ends_the_run_with_its_reason() {
    let twice = "stages.masking.restart.limit=2";
    let burns = "echo 'the mask is on fire' >&2; exit 7";
    let burnt = [
        "masking died 3 times",
        "exit code 7",
        "mask is on fire",
        "giving up",
    ];
    // A failure with this exit code would come again.
    let lacks = "echo 'masking: no licence' >&2; exit 2";
    let late = [
        "masking has not opened its topics within 500ms",
        "three times in a row",
    ];
    for (script, setting, words, restarts) in [
        ("exec sleep 600", "run.start_timeout_s=0.5", &late[..], None),
        (burns, twice, &burnt, Some(2)),
        (lacks, twice, &["masking: no licence"], Some(0)),
    ] {
        let run = Run::of_recording().stage_script("masking", script);
        let ended = run.set(setting).finish();
        ended.failed_with(words);
        let restarted = ended.stderr.matches("restarted ").count();
        assert!(
            restarts.is_none_or(|restarts| restarts == restarted),
            "{ended:?}"
        );
    }
}
