//! Swaps: another program takes the place of a stage of a running run, or fails to.

use std::{
    process::{Child, Stdio},
    thread,
    time::{Duration, Instant},
};

use rustix::process::Signal;
use serde_json::Value;

use crate::{
    PROGRAM,
    common::{BETWEEN, Ended, Run, STAGES, gyre, install, undisturbed},
    operate::commands::{ask, process, started, status},
    reach::conformance,
};

/// A swap; the command comes last.
fn swap(run: &Run, stage: &str, options: &[&str], command: &[&str]) -> Ended {
    let mut words = gyre();
    words.args(["swap", stage]).arg(run.out()).args(options);
    if !command.is_empty() {
        words.arg("--command").arg(shell_words(command));
    }
    Ended::of(words)
}

/// Words as one argument, each in quotes.
fn shell_words(words: &[&str]) -> String {
    let quoted = words.iter().map(|word| word.replace('\'', r"'\''"));
    let quoted: Vec<_> = quoted.map(|word| format!("'{word}'")).collect();
    quoted.join(" ")
}

#[test]
fn each_stage_gives_way_to_another_program_and_back_without_a_lost_scan() {
    // Thirty seconds, since the machine may be busy.
    let run = Run::of_recording().rate("0.2");
    let running = run.started(2);
    for stage in STAGES {
        swap(&run, stage, &[], &["nice", PROGRAM, "stage", stage]).succeeded();
        let status = status(&run).unwrap();
        assert_eq!(process(&status, stage)["is_swapped"], true, "{stage}");
    }
    swap(&run, "masking", &[], &[]).succeeded();
    swap(&run, "rotation-search", &["--cold"], &[]).succeeded();
    assert_eq!(running.complete(), undisturbed());
    let summary = run.summary();
    assert_eq!(summary["swaps"].as_array().unwrap().len(), STAGES.len() + 2);
    assert_eq!(summary["dropped"], 0);
}

#[test]
fn a_program_that_cannot_take_over_changes_nothing() {
    let (run, mut running) = started();
    let before = running.await_stage("masking");
    for (command, reason) in [
        (&["false"][..], "exit code 1"),
        (&["sh", "-c", "echo no network >&2; exit 2"], "no network"),
        (&["/nowhere/masking"], "cannot start masking"),
    ] {
        swap(&run, "masking", &[], command).refused_with(&[reason]);
    }
    swap(&run, "steering", &[], &["true"]).refused_with(&["steering"]);
    assert_eq!(running.await_stage("masking"), before);
    assert_eq!(running.complete(), undisturbed());
}

#[test]
fn a_program_that_fails_gives_way_to_the_one_before_and_the_swap_says_why() {
    // Twenty seconds, since the machine may be busy.
    let run = Run::of_recording().rate("0.3");
    let running = run.started(2);
    let fails = script(&run, "fails.sh", FAILS);
    let cold = script(&run, "cold.sh", "echo no such mask >&2\nexit 3");
    for (options, program, reason, words) in [
        (&[][..], &*fails, "fails.sh` has failed", "no such mask"),
        (&["--cold"], &cold, "cold.sh` has failed", "exit code 3"),
        (&["--cold"], "/nowhere/masking", "cannot start masking", ""),
    ] {
        let refused = swap(&run, "masking", options, &[program]);
        refused.refused_with(&[reason, words, "masking continues as before"]);
        let status = status(&run).unwrap();
        let back = process(&status, "masking");
        assert_eq!(back["is_swapped"], false);
        assert_eq!(back["last_death"], Value::Null, "it was of another program");
    }
    ask(&run, &["down"]).succeeded();
    running.end().says("goes back to the program before");
    let rest = Run::of_recording().into(run.out());
    assert_eq!(rest.complete(), undisturbed());
}

/// An executable script.
fn script(run: &Run, name: &str, text: &str) -> String {
    let path = run.folder().join(name);
    install(&path, format!("#!/bin/sh\n{text}\n"));
    path.to_str().unwrap().to_owned()
}

/// A masking stage that stands by as the contract demands, and then dies.
const FAILS: &str = "touch $GYRE_RUN/masking.ready\ncat\necho no such mask >&2\nexit 3";

#[test]
fn a_program_that_was_edited_is_taken_by_a_swap_alone_and_gives_way_when_it_fails() {
    // A minute, since the machine may be busy.
    let run = Run::of_recording().rate("0.1");
    let running = run.started(2);
    let own = script(&run, "own.sh", &format!("exec {PROGRAM} stage masking"));
    swap(&run, "masking", &[], &[&own]).succeeded();
    let before = process(&status(&run).unwrap(), "masking")["pid"].clone();
    script(&run, "own.sh", FAILS);
    ask(&run, &["restart", "masking"]).refused_with(&["own.sh has changed", "gyre swap masking"]);
    assert_eq!(process(&status(&run).unwrap(), "masking")["pid"], before);
    // The file of the earlier program has changed by now, so the swap returns to the program of the
    // run's start.
    swap(&run, "masking", &[], &[&own]).refused_with(&["own.sh` has failed", "no such mask"]);
    let status = status(&run).unwrap();
    assert_eq!(process(&status, "masking")["is_swapped"], false);
    running.signal(Signal::INT);
    assert_eq!(running.end().code(), Some(130));
    let rest = Run::of_recording().into(run.out());
    assert_eq!(rest.complete(), undisturbed());
}

#[test]
fn a_program_whose_messages_no_stage_can_read_gives_way_and_does_not_end_the_run() {
    let (run, running) = started();
    let nonsense = ["sh", "-c", &conformance::command("sends only NaN")];
    swap(&run, "rotation-search", &["--cold"], &nonsense).refused_with(&[
        "rotation-search continues as before",
        "translation-search died after it",
        "NaN",
    ]);
    assert_eq!(running.complete(), undisturbed());
}

#[test]
fn a_swap_without_a_scan_to_try_the_program_says_so_with_a_code_of_its_own() {
    // Nothing comes for a minute after the first scans.
    let run = Run::of_recording().rate("0.01");
    let running = run.started(1);
    let own = ["nice", PROGRAM, "stage", "rotation-search"];
    let ended = swap(&run, "rotation-search", &[], &own);
    assert_eq!(ended.code(), Some(2), "{}", ended.stderr);
    let reason = "no scan has gone through it";
    ended.says(reason);
    ask(&run, &["down"]).succeeded();
    running.end();
}

#[test]
fn a_swap_that_is_interrupted_leaves_nobody_standing_by() {
    let (run, running) = started();
    let mut client = swapping(&run, &[]);
    thread::sleep(Duration::from_millis(200));
    client.kill().unwrap();
    client.wait().unwrap();
    let since = Instant::now();
    let own = ["nice", PROGRAM, "stage", "masking"];
    while !swap(&run, "masking", &[], &own).status.success() {
        assert!(since.elapsed().as_secs() < 10, "the first one stands by");
    }
    assert_eq!(running.complete(), undisturbed());
}

/// A swap command that has been started.
fn swapping(run: &Run, options: &[&str]) -> Child {
    let mut words = gyre();
    words.args(["swap", "masking", "--command", "sleep 60"]);
    words.arg(run.out()).args(options).stderr(Stdio::piped());
    words.spawn().unwrap()
}

fn said(client: Child) -> String {
    let output = client.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    String::from_utf8(output.stderr).unwrap()
}

#[test]
fn a_supervisor_that_hangs_is_not_waited_for_and_does_nothing_of_that_later() {
    let run = Run::of_recording().rate("0.3");
    let mut running = run.start();
    running.await_poses(2).signal(Signal::STOP);
    let swapping = [&[][..], &["--cold"]].map(|options| swapping(&run, options));
    let mut restart = gyre();
    restart.args(["restart", "masking"]).arg(run.out());
    let restarting = restart.stderr(Stdio::piped()).spawn().unwrap();
    let since = Instant::now();
    ask(&run, &["ps"]).failed_with(&["does not answer"]);
    for client in swapping.into_iter().chain([restarting]) {
        let said = said(client);
        let later = "not begun by now it does not begin";
        let silent = said.contains("does not answer");
        assert!(silent && said.contains(later), "{said}");
    }
    assert!(since.elapsed().as_secs() < 40, "{:?}", since.elapsed());
    running.signal(Signal::CONT);
    assert_eq!(running.complete(), undisturbed());
    let summary = run.summary();
    assert_eq!(summary["swaps"], Value::Null);
    assert_eq!(summary["restarts"], serde_json::json!({}));
}

#[test]
fn a_live_run_drops_no_scan_when_its_stages_are_swapped_one_after_the_other() {
    // A scan each second: the window of four gives a loaded machine time.
    let run = Run::of_recording().rate("0.25");
    let run = run.sets("run.mode=live source.scans=16");
    let running = run.started(4);
    for &stage in BETWEEN {
        swap(&run, stage, &[], &["nice", PROGRAM, "stage", stage]).succeeded();
    }
    running.finish().succeeded();
    assert_eq!(run.summary()["dropped"], 0);
}
