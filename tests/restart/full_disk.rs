//! A full disk: the exit code and, if it can be written, a sentence report the cause; nothing
//! panics.

use std::{fs::File, path::Path, process::Command, thread::sleep, time::Duration};

use rustix::process::Signal;

use crate::{
    common::{
        Ended, Run, Running, can_mount, entries_of, gyre, odometry, recording, send, undisturbed,
        with_tmpfs, wrapped,
    },
    live::radar::{Radar, run_at},
    operate::commands::{ask, await_status},
    restart::faults::tools::Mount,
};

/// A device on which every write fails as on a full disk.
fn full() -> File {
    File::options().write(true).open("/dev/full").unwrap()
}

fn with_full_output(mut command: Command) -> Ended {
    command.stdout(full());
    Ended::of(command)
}

fn exit_code_without_errors(mut command: Command) -> Option<i32> {
    command.stdout(full()).stderr(full());
    command.status().unwrap().code()
}

fn command(arguments: &[&str]) -> Command {
    let mut command = gyre();
    command.args(arguments);
    command
}

#[test]
fn results_that_cannot_be_printed_are_a_failure_in_a_sentence() {
    let recording = recording::small().to_str().unwrap();
    for arguments in [&["inspect", recording][..], &["--help"], &["schema"]] {
        with_full_output(command(arguments))
            .refused_with(&["cannot write to standard output", "No space left"]);
    }
}

#[test]
fn a_run_that_cannot_print_has_its_results_all_the_same() {
    let run = Run::of_recording();
    assert_eq!(exit_code_without_errors(run.command()), Some(1));
    assert_eq!(run.odometry(), undisturbed());
}

#[test]
fn an_error_that_cannot_be_printed_is_told_by_the_exit_code() {
    for (arguments, code) in [
        (&["inspect", "/nowhere"][..], 1),
        (&["stage", "nowhere"], 1),
        (&["stage", "masking"], 2),
        (&["--nonsense"], 2),
    ] {
        assert_eq!(exit_code_without_errors(command(arguments)), Some(code));
    }
}

#[test]
fn a_full_disk_ends_a_run_with_the_reason_and_a_live_one_when_all_poses_are_computed() {
    let last = format!("to {} are lost", recording::SCANS - 1);
    for (mode, words) in [
        ("lossless", &["No space left on device"][..]),
        ("live", &["was full: poses", &last]),
    ] {
        let run = Run::of_recording().set(&format!("run.mode={mode}"));
        let run = run.rate("2");
        std::fs::create_dir(run.out()).unwrap();
        let Some(command) = with_tmpfs(&run.command(), run.out(), "size=64k") else {
            return;
        };
        let ended = run.start_as(command).finish();
        ended.failed_with(words);
        ended.failed_with(&[&run.out().display().to_string()]);
    }
}

/// More than a run has.
const PLENTY: u64 = 256 << 20;

/// Waits until more than this number of poses are in memory only.
fn await_held(run: &Run, running: &Running, poses: u64) {
    let kept = running.poses() as u64;
    await_status(run, "poses that are held", |status| {
        status["disk_is_full"] == true && status["poses"].as_u64() > Some(kept + poses)
    });
}

#[test]
fn poses_on_a_full_disk_are_written_when_there_is_room_again() {
    if !can_mount() {
        return;
    }
    let run = Run::of_recording().sets("run.mode=live source.repeat=true source.scans=4000");
    let run = run.rate("2");
    let mount = Mount::tmpfs(run.out(), PLENTY);
    let mut running = run.started(3);
    mount.fill(0);
    running.await_words("held in memory until there is room");
    // The system counts the pages of a full disk not exactly: a last one may be found later.
    let full = "is full: poses continue";
    while !ask(&run, &["ps", "--check"]).stderr.contains(full) {
        assert!(!running.is_over(), "it was never said");
    }
    await_held(&run, &running, 3);
    mount.free();
    await_status(&run, "room on the disk", |status| {
        status["disk_is_full"] == false
    });
    // At a stop a process has time to write the poses that it held, also to a slow disk.
    mount.fill(0);
    await_held(&run, &running, 3);
    let holder = running.await_stage("pose-integration");
    send(holder, Signal::STOP);
    mount.free();
    running.signal(Signal::INT);
    sleep(Duration::from_secs(4));
    send(holder, Signal::CONT);
    running.interrupt();
    run.assert_counts("breaks=0");
    let rows = odometry::rows(&run.odometry());
    assert_eq!(rows.len() as u64 + 1, run.count("processed"));
}

#[test]
fn a_live_run_begins_again_behind_its_journal_if_poses_of_a_full_disk_are_lost() {
    if !can_mount() {
        return;
    }
    for stage in ["pose-integration", "refinement"] {
        let radar = Radar::playing(recording::small(), &["--repeat"]);
        let run = run_at(&radar.address);
        let mount = Mount::tmpfs(run.out(), PLENTY);
        let mut running = run.started(4);
        mount.fill(0);
        // More than the refinement computes again after a death.
        await_held(&run, &running, 12);
        running.kill(stage);
        running.await_words("; starting over");
        mount.free();
        let kept = running.poses();
        running.await_poses(kept + 8);
        running.interrupt();
        run.assert_counts("breaks=1");
    }
}

#[test]
fn a_run_that_loses_poses_ends_when_it_is_asked_to() {
    if !can_mount() {
        return;
    }
    let script = "trap '' TERM; test -e $0.late && sleep 1; exec {gyre} stage pose-integration";
    let radar = Radar::playing(recording::small(), &["--repeat"]);
    let run = run_at(&radar.address).stage_script("pose-integration", script);
    let mount = Mount::tmpfs(run.out(), PLENTY);
    let mut running = run.started(4);
    mount.fill(0);
    await_held(&run, &running, 2);
    let script = run.folder().join("pose-integration.sh");
    File::create(script.with_extension("sh.late")).unwrap();
    running.kill("pose-integration");
    running.await_child(script.to_str().unwrap(), None);
    ask(&run, &["down"]);
    let ended = running.finish();
    ended
        .does_not_say("starting over")
        .failed_with(&["are lost"]);
}

#[test]
fn logs_that_cannot_be_written_do_not_disturb_a_run() {
    let run = Run::of_recording();
    run.interrupt("6", 3);
    let logs = entries_of(&run.out().join("log"));
    for log in logs.into_iter().chain([run.out().join("log.jsonl")]) {
        std::fs::remove_file(&log).unwrap();
        std::os::unix::fs::symlink(Path::new("/dev/full"), &log).unwrap();
    }
    let command = wrapped(&["env", "GYRE_LOG=trace"], &run.command());
    run.start_as(command)
        .finish()
        .succeeded()
        .does_not_say("died");
    assert_eq!(run.odometry(), undisturbed());
}
