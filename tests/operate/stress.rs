//! `gyre stress`: verdicts, exit codes, and faults that a measurement must not hide.

use std::{
    fs,
    io::{BufRead, BufReader},
    path::{Path, PathBuf},
    process::Stdio,
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use gyre_client::{Usage, control::Control, memory};
use rustix::process::Signal;
use serde_json::Value;
use tempfile::TempDir;

use crate::common::{Ended, assert_nothing_left, folder, gyre, install, recording, send, wrapped};

/// Time between two scans of the recording, s.
const PERIOD_S: f64 = 0.25;

/// Time for what takes some seconds on a machine that is not loaded.
const LIMIT: Duration = Duration::from_secs(120);

/// A stress test of the small recording.
struct Stress {
    folder: TempDir,
}

impl Stress {
    fn new() -> Self {
        Self::of(recording::small())
    }

    fn of(data: &Path) -> Self {
        let (folder, data) = (folder(), data.display());
        let small = folder.path().join("small.toml");
        let raster = fs::read_to_string(&small).unwrap();
        fs::write(&small, format!("[source]\ndata = '{data}'\n{raster}")).unwrap();
        Self { folder }
    }

    fn out(&self) -> PathBuf {
        self.folder.path().join("out")
    }

    /// Runs it with words that spaces part.
    fn run(&self, words: &str) -> Ended {
        self.start(words).join().unwrap()
    }

    /// Starts it; its end must come.
    fn start(&self, words: &str) -> JoinHandle<Ended> {
        let mut command = gyre();
        command.arg("stress");
        command.arg(self.folder.path().join("small.toml"));
        command.arg("--out").arg(self.out()).args(words.split(' '));
        let command = wrapped(&["timeout", "120"], &command);
        thread::spawn(|| Ended::of(command))
    }

    /// The folder of the results of a run.
    fn run_out(&self, run: &str) -> PathBuf {
        self.out().join("runs").join(run)
    }

    /// The outcome of the first scenario.
    fn outcome(&self) -> Value {
        self.outcomes()[0].clone()
    }

    fn outcomes(&self) -> Value {
        let text = fs::read_to_string(self.out().join("report.json")).unwrap();
        serde_json::from_str::<Value>(&text).unwrap()["outcomes"].clone()
    }

    /// Asserts that the test was not carried out, and printed these words.
    fn is_not_carried_out(&self, words: &str, said: &[&str]) {
        let ended = self.run(words);
        assert_eq!(ended.code(), Some(2), "{}", ended.stderr);
        let printed = ended.stdout + &ended.stderr;
        assert!(said.iter().all(|it| printed.contains(it)), "{printed}");
    }

    fn assert_nothing_left(&self, run: &str) {
        assert_nothing_left(&self.run_out(run));
    }
}

/// The standard output of a test that has found a failure.
fn failed(ended: Ended) -> String {
    assert_eq!(ended.code(), Some(1), "{}", ended.stderr);
    ended.stdout
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value}"))
}

#[test]
fn a_generous_budget_is_kept_and_an_impossible_one_is_named() {
    let stress = Stress::new();
    let steady = |budget| format!("--scenario steady --duration 3 --set budget.{budget}");
    stress.run(&steady("max_ms=60000")).succeeded();
    assert!(stress.out().join("config.toml").exists());
    let outcome = stress.outcome();
    assert_eq!(outcome["verdict"], "passed");
    let counts = &outcome["figures"]["counts"];
    assert_eq!(counts["due"], 12, "{counts}");
    let processes = outcome["figures"]["processes"].as_array().unwrap();
    assert!(processes.iter().any(|cost| cost["name"] == "masking"));
    let said = failed(stress.run(&steady("steady.p50_ms=0.001")));
    assert!(said.contains("steady: FAILED; p50_ms"), "{said}");
    assert!(said.contains("limit 0.001"), "{said}");
    stress.assert_nothing_left("steady");
}

#[test]
fn the_sensors_clock_goes_on_while_its_source_is_dead() {
    let stress = Stress::new();
    let words = "--scenario kills --stage radar-replay --duration 6";
    stress.run(words).succeeded();
    let figures = &stress.outcome()["figures"];
    let summary = fs::read_to_string(stress.run_out("kills").join("summary.json")).unwrap();
    let summary: Value = serde_json::from_str(&summary).unwrap();
    assert_eq!(summary["restarts"]["radar-replay"], 1);
    assert!(number(&figures["faults"][0]["recovery_ms"]) > 0.0);
    // 6 s of 4 scans/s, with the time without a source.
    assert_eq!(figures["counts"]["due"], 24);
    stress.assert_nothing_left("kills");
}

#[test]
fn a_test_that_cannot_be_carried_out_is_no_verdict() {
    let stress = Stress::new();
    for (words, said) in [
        ("nowhere --scenario steady", ["gyre stress: ", "nowhere"]),
        (
            "--set budget.stedy.p50_ms=1 --scenario steady",
            ["", "did you mean `steady`?"],
        ),
        (
            "--scenario kills --duration 3 --set budget.recovery_ms=1",
            ["kills: NOT CARRIED OUT", "needs --duration 5 or more"],
        ),
        (
            "--scenario steady --set run.observers=0",
            ["", "set run.observers to 1 or more"],
        ),
    ] {
        stress.is_not_carried_out(words, &said);
    }
    stress.assert_nothing_left("steady");
}

#[test]
fn a_stage_behind_a_shell_is_measured_and_stopped_with_all_that_it_has_started() {
    let stress = Stress::new();
    // The shell stays, and its name differs from the stage's.
    let shell = stress.folder.path().join("shell.sh");
    let script = format!("#!/bin/sh\n{} stage masking\nexit $?\n", crate::PROGRAM);
    install(&shell, script);
    let command = format!("stages.masking.command=['{}']", shell.display());
    let stopped = "--scenario stopped --stage masking --duration 6";
    stress
        .run(&format!("{stopped} --set {command}"))
        .succeeded();
    let outcome = stress.outcome();
    assert_eq!(outcome["verdict"], "passed");
    let figures = &outcome["figures"];
    assert_eq!(figures["faults"][0]["stage"], "masking");
    // If only the shell were stopped, the stage would continue.
    let longest = number(&figures["sensor_to_pose"]["max_ms"]);
    assert!(longest >= 1e3 * (1.0 - PERIOD_S), "{longest} ms");
    let processes = figures["processes"].as_array().unwrap();
    let masking = processes.iter().find(|cost| cost["name"] == "masking");
    assert_eq!(masking.unwrap()["processes"], 2);
    stress.assert_nothing_left("stopped");
}

#[test]
fn stages_that_are_slow_are_not_judged_without_a_limit() {
    let stress = Stress::new();
    let slow = "--scenario slow-stage --duration 2 --stage masking --stage refinement";
    stress.run(slow).succeeded();
    assert_eq!(stress.outcome()["verdict"], "not-judged");
    let run = fs::read_to_string(stress.run_out("slow-stage").join("config.toml")).unwrap();
    assert_eq!(run.matches("delay_ms = 300").count(), 2, "{run}");
}

/// Waits until a run has more poses than the warm-up takes.
fn await_measurement(out: &Path) {
    let poses = || Some(Control::of(out).ok()?.status().ok()?.poses);
    let since = Instant::now();
    while poses().is_none_or(|poses| poses <= 12) {
        assert!(since.elapsed() < LIMIT, "no poses in {}", out.display());
        thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn what_a_killed_run_has_left_is_not_measured() {
    let stress = Stress::new();
    let measured = stress.start("--scenario steady --scenario steady --duration 6");
    let out = stress.run_out("steady");
    await_measurement(&out);
    // Its files in shared memory stay, where the next run has its own.
    let supervisor = Control::of(&out).unwrap().status().unwrap().pid;
    send(supervisor, Signal::KILL);
    failed(measured.join().unwrap());
    let outcomes = stress.outcomes();
    let [killed, next] = [0, 1].map(|index| &outcomes[index]);
    assert_eq!(killed["verdict"], "failed");
    let problem = killed["problem"].as_str().unwrap();
    assert!(problem.contains("killed by signal 9"), "{problem}");
    assert_eq!(next["verdict"], "not-judged");
    assert_eq!(next["figures"]["counts"]["due"], 24);
    stress.assert_nothing_left("steady");
}

/// The helper is asked for so little that other programs do not notice.
#[test]
fn a_load_takes_no_more_memory_than_it_is_asked_for_and_is_none_without_any() {
    let helper = |work: &str| {
        let mut command = gyre();
        command
            .arg("stress-helper")
            .arg(std::process::id().to_string());
        command.arg(work);
        command
    };
    let mut load = helper(r#"{"memory":0.01}"#);
    let mut load = load.stdout(Stdio::piped()).spawn().unwrap();
    let mut said = String::new();
    let mut output = BufReader::new(load.stdout.take().unwrap());
    output.read_line(&mut said).unwrap();
    let taken = Usage::of(load.id()).unwrap().own_bytes;
    load.kill().unwrap();
    load.wait().unwrap();
    assert_eq!(said, "ready\n");
    let most = memory::left().unwrap() / 50 + (100 << 20);
    assert!(taken <= most, "{taken} bytes of {most}");
    let nothing = helper(r#"{"memory":0.0}"#);
    Ended::of(nothing).failed_with(&["no memory was taken", "are always left"]);
}
