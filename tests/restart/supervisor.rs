//! Tests of the supervisor's duties to the machine: no process outlives a run, no log grows for
//! ever, and the supervisor waits for room.

use std::{thread, time::Duration};

use rustix::process::Signal;

use crate::common::{OtherUser, Run, leftovers, recording, send, undisturbed};

/// A stage under a shell that has started another program, which knows nothing of the run.
const SHELL: &str = "sleep 600 &\n{gyre} stage masking";

#[test]
fn what_a_stage_has_started_ends_with_a_killed_supervisor() {
    let run = Run::of_recording().rate("2").stage_script("masking", SHELL);
    let running = run.started(2);
    let before = running.shared_memory_bytes();
    assert!(before > 1_000_000, "{before}");
    running.kill_supervisor();
    // Its guardian has ended too.
    leftovers::assert_nothing_left(run.out());
    assert_eq!(run.complete(), undisturbed());
}

#[test]
fn a_killed_guardian_is_replaced_and_knows_all_stages() {
    let run = Run::of_recording().rate("2").stage_script("masking", SHELL);
    let mut running = run.start();
    let guardian = running.await_poses(2).await_child("guard", None);
    send(guardian, Signal::KILL);
    running.await_child("guard", Some(guardian));
    running.kill_supervisor();
    leftovers::assert_nothing_left(run.out());
}

#[test]
fn what_a_stage_has_started_ends_with_the_run() {
    let run = Run::of_recording().stage_script("masking", SHELL);
    assert_eq!(run.complete(), undisturbed());
}

/// As one whose last synchronisation fails, when all poses have been seen.
#[test]
fn a_stage_that_fails_while_it_is_ended_fails_the_run() {
    let script = "trap 'echo the disk is gone >&2; exit 2' TERM\n{gyre} stage refinement & wait";
    let run = Run::of_recording().stage_script("refinement", script);
    let all = format!("{} poses are kept", recording::SCANS);
    run.finish().failed_with(&["the disk is gone", &all]);
    assert!(!run.out().join("journal/complete").exists());
    assert_eq!(run.odometry(), undisturbed(), "what it had is written");
}

#[test]
fn a_stage_that_always_has_work_does_not_hang() {
    let run = Run::of_recording().sets("run.stall_timeout_s=4 stages.masking.delay_ms=400");
    assert_eq!(run.complete(), undisturbed());
    // There was always a scan in its queue, for longer than the limit.
    assert_eq!(run.summary()["restarts"], serde_json::json!({}));
}

/// The limits of the system's processes do not hold for root, so the run is another user's.
#[test]
fn a_stage_for_which_there_is_no_process_is_started_when_there_is_one() {
    let run = Run::simulated(24).rate("6");
    let Some(user) = OtherUser::new(run.folder()) else {
        return;
    };
    let mut running = run.start_as(user.command_of(&run));
    let supervisor = running.await_poses(3).pid().to_string();
    let allow_processes = |number: &str| {
        let mut prlimit = user.command();
        let limit = format!("--nproc={number}:");
        prlimit.args(["prlimit", "--pid", &supervisor, &limit]);
        assert!(prlimit.status().unwrap().success());
    };
    allow_processes("1");
    running.kill("masking");
    thread::sleep(Duration::from_millis(500));
    assert!(!running.stages().contains_key("masking"));
    allow_processes("1000");
    running.finish().succeeded();
    assert_eq!(run.summary()["restarts"]["masking"], 1);
}
