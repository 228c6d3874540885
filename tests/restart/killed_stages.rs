//! `kill -9` of stages: each is started again, and the result is the undisturbed run's, byte for
//! byte.

use std::fs;

use crate::common::{Pid, Run, Running, STAGES, leftovers, odometry, recording, send, undisturbed};
use rustix::process::Signal;
use serde_json::Value;

/// The recording's six seconds in one.
const MODERATE: &str = "6";
const MIDDLE: usize = recording::SCANS / 3;

/// Disturbs a run once it is in its middle, and asserts that this changes nothing but the count of
/// restarts of `stages`.
fn survives(stages: &[&str], disturb: impl FnOnce(&mut Running)) {
    let run = Run::of_recording().rate(MODERATE);
    let mut running = run.start();
    disturb(&mut running);
    let ended = running.finish();
    ended.succeeded();
    assert_eq!(run.odometry(), undisturbed(), "{}", ended.stderr);
    let summary = run.summary();
    assert_eq!(summary["published"], recording::SCANS);
    for stage in STAGES {
        let times = summary["restarts"]
            .get(stage)
            .and_then(Value::as_u64)
            .unwrap_or(0);
        assert_eq!(
            times > 0,
            stages.contains(&stage),
            "{stage}: {}\n{}",
            summary["restarts"],
            ended.stderr
        );
    }
}

fn survives_the_death_of(stage: &str) {
    survives(&[stage], |running| {
        running.await_poses(MIDDLE).kill(stage);
    });
}

#[test]
fn a_killed_radar_replay_goes_on() {
    survives_the_death_of("radar-replay");
}

#[test]
fn a_killed_masking_goes_on() {
    survives_the_death_of("masking");
}

#[test]
fn a_killed_rotation_search_goes_on() {
    survives_the_death_of("rotation-search");
}

#[test]
fn a_killed_translation_search_goes_on() {
    survives_the_death_of("translation-search");
}

#[test]
fn a_killed_refinement_goes_on() {
    survives_the_death_of("refinement");
}

#[test]
fn a_killed_pose_integration_goes_on() {
    survives_the_death_of("pose-integration");
}

/// Where azimuths were lost is found from scan to scan, so a restart is to know it of the last one.
#[test]
#[ignore = "nightly: kills at many moments"]
fn a_stage_killed_amid_scans_with_lost_azimuths_goes_on() {
    let of_radiate = || {
        let run = Run::small().data(&recording::of_radiate(true));
        run.rate(MODERATE)
    };
    let undisturbed = of_radiate();
    undisturbed.complete();
    let ignored = of_radiate().set("dataset.lost_azimuths=ignore");
    ignored.complete();
    assert_ne!(undisturbed.odometry(), ignored.odometry());
    for stage in ["radar-replay", "masking", "pose-integration"] {
        let run = of_radiate();
        let mut running = run.start();
        running.await_poses(12).kill(stage);
        running.finish().succeeded();
        assert_eq!(run.odometry(), undisturbed.odometry(), "{stage}");
    }
}

#[test]
fn two_stages_killed_at_once_go_on() {
    survives(&["masking", "translation-search"], |running| {
        running
            .await_poses(MIDDLE)
            .kill("masking")
            .kill("translation-search");
    });
}

#[test]
fn all_stages_killed_at_once_go_on() {
    survives(&STAGES, |running| {
        let stages = running.await_stages();
        running.await_poses(MIDDLE);
        stages.values().for_each(|pid| send(*pid, Signal::KILL));
    });
}

#[test]
fn a_stage_killed_again_after_each_few_poses_goes_on() {
    survives(&["rotation-search"], |running| {
        for poses in [4, 9, 14] {
            running.await_poses(poses).kill("rotation-search");
        }
    });
}

#[test]
fn a_stage_killed_in_the_first_milliseconds_of_its_life_goes_on() {
    for stage in STAGES {
        survives(&[stage], |running| {
            let first = running.await_stage(stage);
            send(first, Signal::KILL);
        });
    }
}

#[test]
fn a_restart_killed_in_the_first_milliseconds_of_its_life_goes_on() {
    survives(&["rotation-search"], |running| {
        let first = running.await_poses(MIDDLE).await_stage("rotation-search");
        send(first, Signal::KILL);
        let second = running.await_other_stage("rotation-search", first);
        send(second, Signal::KILL);
    });
}

#[test]
#[ignore = "nightly: kills at many moments"]
fn a_stage_killed_when_all_poses_are_there_does_not_take_them_back() {
    for stage in STAGES {
        let run = Run::of_recording();
        let mut running = run.start();
        let pid = running.await_stage(stage);
        running.await_poses_or_end(recording::SCANS);
        send(pid, Signal::KILL);
        running.finish().succeeded();
        assert_eq!(run.odometry(), undisturbed(), "{stage}");
    }
}

#[test]
fn a_stage_that_somebody_else_asks_to_end_is_started_again() {
    survives(&["translation-search"], |running| {
        let pid = running
            .await_poses(MIDDLE)
            .await_stage("translation-search");
        send(pid, Signal::TERM);
    });
}

/// Stops a process as a replacement may hang that writes no heartbeat.
fn stop_without_a_heartbeat(run: &Run, name: &str, pid: Pid) {
    send(pid, Signal::STOP);
    let beat = format!("{name}.heartbeat");
    fs::remove_file(leftovers::root(run.out()).join(beat)).unwrap();
}

#[test]
fn a_stage_that_hangs_without_a_heartbeat_is_noticed_and_all_are_started_again() {
    let run = Run::of_recording()
        .rate(MODERATE)
        .set("run.stall_timeout_s=2");
    let mut running = run.start();
    let pid = running.await_poses(MIDDLE).await_stage("rotation-search");
    stop_without_a_heartbeat(&run, "rotation-search", pid);
    let ended = running.finish();
    ended.succeeded();
    assert!(ended.stderr.contains("no pose for 2s"), "{}", ended.stderr);
    assert_eq!(run.odometry(), undisturbed());
}

#[test]
fn a_source_that_hangs_without_a_heartbeat_is_noticed_and_started_again() {
    for rate in [MODERATE, "max"] {
        let run = Run::of_recording().rate(rate).set("run.stall_timeout_s=2");
        let mut running = run.start();
        let pid = running.await_poses(3).await_stage("radar-replay");
        stop_without_a_heartbeat(&run, "radar-replay", pid);
        let ended = running.finish();
        ended.succeeded();
        assert!(
            ended.stderr.contains("no scan from the source for 2s"),
            "{}",
            ended.stderr
        );
        assert_eq!(run.odometry(), undisturbed());
        assert_eq!(run.summary()["restarts"]["radar-replay"], 1);
    }
}

#[test]
fn slow_playback_is_no_stall() {
    // 2.5 s from scan to scan.
    let run = Run::of_recording()
        .rate("0.1")
        .set("source.scans=4")
        .set("run.stall_timeout_s=1.5");
    let ended = run.finish();
    ended.succeeded();
    assert!(!ended.stderr.contains("restarted"), "{}", ended.stderr);
}

#[test]
fn a_stage_that_takes_long_to_start_is_no_stall() {
    let run = Run::of_recording()
        .stage_script("masking", "sleep 4; exec {gyre} stage masking")
        .set("run.stall_timeout_s=1");
    let ended = run.finish();
    ended.succeeded();
    assert!(!ended.stderr.contains("restarted"), "{}", ended.stderr);
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
fn a_source_killed_behind_an_unreadable_scan_still_counts_it() {
    let recording = recording::copy(16);
    recording::truncate(&recording::images(recording.path())[4], 100_000);
    let run = Run::of_recording_named(recording.path().to_str().unwrap());
    let alone = run.complete();
    let run = Run::of_recording_named(recording.path().to_str().unwrap()).rate(MODERATE);
    let mut running = run.start();
    running.await_poses(9).kill("radar-replay");
    running.finish().succeeded();
    assert_eq!(run.odometry(), alone);
    assert_eq!(
        (&run.summary()["published"], &run.summary()["unreadable"]),
        (&15.into(), &1.into())
    );
}

#[test]
fn a_stage_that_always_dies_ends_the_run_with_its_last_line_of_output() {
    let run = Run::of_recording()
        .stage_script("masking", "echo 'the mask is on fire' >&2; exit 7")
        .set("stages.masking.restart={limit = 2, backoff_ms = 10}");
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
    assert!(!ended.stderr.contains("restarted "), "{}", ended.stderr);
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
