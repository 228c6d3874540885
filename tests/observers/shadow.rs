//! `gyre shadow`: a second program beside a stage of a running run. The shadow never changes the
//! run; its answers are compared.

use std::{fs, path::PathBuf, sync::OnceLock};

use rustix::process::Signal;
use serde_json::Value;

use crate::{
    common::{BETWEEN, Ended, Pid, Run, Running, Spawned, gyre, processes, send, undisturbed},
    input::breaks,
    method::learned_masks::{TWO_SCANS, card},
    operate::commands::{ask, up},
    reach::conformance,
};

const SCANS: usize = 160;
/// Such a run takes some seconds then.
const RATE: &str = "16";
/// Where shadows are to keep up on a busy machine.
const HALF_RATE: &str = "8";

/// A run of the small recording, again and again.
fn long() -> Run {
    let run = Run::of_recording().set("source.repeat=true");
    run.set(&format!("source.scans={SCANS}"))
}

/// `odometry.csv` of such a run without a shadow.
fn undisturbed_long() -> &'static str {
    static ODOMETRY: OnceLock<String> = OnceLock::new();
    ODOMETRY.get_or_init(|| long().complete())
}

/// Starts a run, and holds it after some poses: it does not end before shadows are there.
fn held(run: &Run) -> Running {
    let running = run.started(1);
    hold(&running);
    running
}

/// Lets no pose pass; all other stages answer the handshakes of observers.
fn hold(running: &Running) {
    send(running.stages()["refinement"], Signal::STOP);
}

fn release(running: &Running) {
    send(running.stages()["refinement"], Signal::CONT);
}

/// A running shadow, and its output.
struct Shadow {
    process: Spawned,
    report: PathBuf,
}

impl Shadow {
    /// Starts one beside a run; `name` is the name of its report.
    fn start(run: &Run, name: &str, stage: &str, options: &[&str]) -> Self {
        let report = run.folder().join(name);
        fs::create_dir_all(&report).unwrap();
        let mut command = gyre();
        command.args(["shadow", stage]).arg(run.out());
        command.arg("--report").arg(&report).args(options);
        let process = Spawned::new(command, report.join("said"));
        Self { process, report }
    }

    /// Waits until it observes the run.
    fn await_attached(&self) {
        self.process
            .until(|said| said.contains("beside").then_some(()));
    }

    /// Waits until it has compared so many items.
    fn await_rows(&self, rows: usize) {
        self.process.until(|_| (self.rows() >= rows).then_some(()));
    }

    /// Waits until it has started a stage.
    fn await_process(&self) -> Pid {
        let stages = || processes::stages_of(self.process.pid());
        self.process.until(|_| stages().into_values().next())
    }

    fn rows(&self) -> usize {
        let rows = fs::read_to_string(self.report.join("shadow.csv"));
        rows.map_or(0, |rows| rows.lines().count().saturating_sub(1))
    }

    /// Waits until it ends; returns its exit code and its report.
    fn end(mut self) -> (Option<i32>, Value) {
        let (code, said) = (self.process.wait().code(), self.process.said());
        println!("{said}");
        let report = fs::read_to_string(self.report.join("shadow.json"));
        let report: Value = serde_json::from_str(&report.unwrap()).unwrap();
        if let Some(at) = said.find("\n{") {
            let printed: Value = serde_json::from_str(&said[at..]).unwrap();
            assert_eq!(printed, report);
        }
        assert_accounted(&report["counts"]);
        let rows = self.rows() as u64;
        assert_eq!(Some(rows), report["counts"]["compared"].as_u64());
        (code, report)
    }
}

/// Asserts that each item that was seen is in one of the counts.
fn assert_accounted(counts: &Value) {
    let count = |key: &str| counts[key].as_u64().unwrap();
    let fates = [
        "compared",
        "opening",
        "skipped",
        "while_starting",
        "unanswered",
        "left",
    ];
    let accounted: u64 = fates.into_iter().map(count).sum();
    assert_eq!(accounted, count("observed"), "{counts:#}");
}

fn assert_identical((code, report): (Option<i32>, Value), least: u64) {
    assert_eq!(code, Some(0), "{report:#}");
    assert_eq!(report["verdict"], "identical");
    assert!(report["counts"]["compared"].as_u64() >= Some(least));
    assert!(report["work"]["shadow"]["p50_us"].as_f64() > Some(0.0));
    assert!(report["answer"]["real"]["p50_us"].as_f64() > Some(0.0));
}

#[test]
fn shadows_that_fail_in_any_way_are_named_and_the_run_is_untouched() {
    let run = long().rate(RATE);
    let running = held(&run);
    let shadow = |name: &str, breach: &str, options: &[&str]| {
        let command = conformance::command(breach);
        let options = [&["--command", &command], options].concat();
        Shadow::start(&run, name, "rotation-search", &options)
    };
    let shadows = [
        shadow("differs", "none", &[]),
        shadow("slow", "is slow", &[]),
        shadow("floods", "floods", &["--scans", "20"]),
        shadow("dies", "dies", &[]),
        shadow("silent", "falls silent", &["--patience-s", "2"]),
    ];
    shadows.iter().for_each(|shadow| shadow.await_rows(1));
    release(&running);
    assert_eq!(running.complete(), undisturbed_long());
    let [differs, slow, floods, dies, silent] = shadows;

    let (code, report) = differs.end();
    assert_eq!((code, &report["verdict"]), (Some(0), &"differs".into()));
    assert!(report["differences"]["rotation_deg"]["max"].as_f64() > Some(0.0));
    let (code, report) = slow.end();
    assert_eq!(code, Some(0));
    assert!(report["counts"]["skipped"].as_u64() > Some(0), "{report:#}");
    assert!(report["work"]["shadow"]["p50_us"].as_f64() > Some(290e3));
    let (code, report) = floods.end();
    assert_eq!(code, Some(1));
    assert!(report["breaches"].to_string().contains("it sent item"));
    let (code, report) = dies.end();
    assert_eq!(code, Some(1));
    assert!(report["ends"].to_string().contains("no memory is left"));
    let (code, report) = silent.end();
    assert_eq!(code, Some(1));
    assert!(report["counts"]["hangs"].as_u64() > Some(0), "{report:#}");
    assert!(report["ends"].to_string().contains("has not answered item"));
}

#[test]
fn a_program_that_does_not_come_is_given_up_while_the_run_goes_on() {
    let run = Run::of_recording().rate("2");
    let running = held(&run);
    let silent = ["--command", "sleep 1000", "--start-timeout-s", "0.2"];
    let silent = Shadow::start(&run, "silent", "masking", &silent);
    let leaves = Shadow::start(&run, "leaves", "masking", &["--command", "false"]);
    for (shadow, count, words) in [
        (silent, "hangs", "has not opened `masked`"),
        (leaves, "deaths", "exit code 1"),
    ] {
        let (code, report) = shadow.end();
        assert_eq!((code, &report["verdict"]), (Some(1), &"nothing".into()));
        assert_eq!(report["counts"][count], 3, "{report:#}");
        assert!(report["ends"].to_string().contains(words), "{report:#}");
    }
    release(&running);
    assert_eq!(running.complete(), undisturbed());
}

#[test]
#[ignore = ".ci/nightly: a drive in several runs"]
fn shadows_that_fall_behind_again_and_again_are_compared_exactly() {
    // The mask takes two scans, and the motions of both.
    let run = long().rate(RATE).masked_by(&card(TWO_SCANS));
    let mut running = held(&run);
    let shadows = ["masking", "translation-search"].map(|stage| {
        let patience = ["--patience-s", "60"];
        Shadow::start(&run, stage, stage, &patience)
    });
    shadows.iter().for_each(Shadow::await_attached);
    let processes = shadows.each_ref().map(Shadow::await_process);
    for poses in [40, 70, 100] {
        processes.iter().for_each(|pid| send(*pid, Signal::STOP));
        release(&running);
        running.await_poses(poses);
        hold(&running);
        let rows = shadows.each_ref().map(Shadow::rows);
        processes.iter().for_each(|pid| send(*pid, Signal::CONT));
        for (shadow, rows) in shadows.iter().zip(rows) {
            shadow.await_rows(rows + 1);
        }
    }
    release(&running);
    running.finish().succeeded();
    for shadow in shadows {
        let (code, report) = shadow.end();
        assert!(report["counts"]["skipped"].as_u64() > Some(20));
        assert_identical((code, report), 5);
    }
}

#[test]
fn shadows_are_compared_exactly_across_a_break_of_the_chain() {
    let run = Run::small().data(&breaks::with_a_gap()).rate("0.5");
    let run = run.masked_by(&card(TWO_SCANS));
    let running = held(&run);
    let shadows = BETWEEN.iter();
    let shadows = shadows.map(|stage| Shadow::start(&run, stage, stage, &["--json"]));
    let shadows: Vec<_> = shadows.collect();
    shadows.iter().for_each(Shadow::await_attached);
    release(&running);
    running.finish().succeeded();
    for shadow in shadows {
        assert_identical(shadow.end(), 5);
    }
}

#[test]
fn masking_of_a_live_run_is_identical_for_the_scans_that_were_not_dropped() {
    let run = long().rate(HALF_RATE);
    let run = run.sets("run.mode=live stages.masking.delay_ms=50");
    let running = run.started(1);
    let shadow = Shadow::start(&run, "masking", "masking", &[]);
    // With many scans dropped, motions may be too long for the radar: that is a problem of its own.
    running.finish();
    assert!(run.summary()["dropped"].as_u64() > Some(0));
    // The shadow does not compare dropped items, nor the items that it has not reached.
    assert_identical(shadow.end(), 1);
}

#[test]
fn a_shadow_of_a_joint_search_in_the_background_ends_after_so_many_items() {
    let run = Run::of_recording().rate("0.3");
    let run = run.sets("raster.n=63 search.kind=exhaustive");
    Ended::of(up(&run)).succeeded();
    let options = ["--scans", "3", "--nice", "15"];
    let shadow = Shadow::start(&run, "joint", "joint-search", &options);
    let (code, report) = shadow.end();
    assert_eq!((code, &report["verdict"]), (Some(0), &"identical".into()));
    assert_eq!(report["counts"]["compared"], 3);
    let nowhere = ["joint-search", "--command", "/nowhere/search"];
    refused(&run, &nowhere, &["cannot start joint-search", nowhere[2]]);
    let words = ["the run has no rotation-search", "joint-search"];
    refused(&run, &["rotation-search"], &words);
    ask(&run, &["down"]).succeeded();
}

#[test]
fn an_interrupted_shadow_reports_and_the_program_of_a_killed_one_ends() {
    let run = Run::of_recording().rate("2");
    let running = held(&run);
    let [interrupted, mut killed] =
        ["interrupted", "killed"].map(|name| Shadow::start(&run, name, "rotation-search", &[]));
    interrupted.await_rows(1);
    interrupted.process.signal(Signal::INT);
    let (code, report) = interrupted.end();
    assert_eq!((code, &report["verdict"]), (Some(0), &"identical".into()));
    killed.await_rows(1);
    let process = killed.await_process();
    killed.process.kill();
    // It does not outlive its shadow.
    killed
        .process
        .until(|_| (!processes::is_alive(process)).then_some(()));
    release(&running);
    assert_eq!(running.complete(), undisturbed());
}

fn refused(run: &Run, arguments: &[&str], words: &[&str]) {
    ask(run, &[&["shadow"], arguments].concat()).refused_with(words);
}

#[test]
fn what_cannot_have_a_shadow_is_refused_in_a_sentence() {
    let run = Run::of_recording();
    for (arguments, words) in [
        ("radar-replay", "is a source"),
        ("pose-integration", "journal"),
        ("trajectory", "logs"),
        ("steering", "no stage `steering`"),
        ("masking", "no run is writing to"),
        ("masking --command 'x", "quotes"),
    ] {
        let arguments: Vec<&str> = arguments.split(' ').collect();
        refused(&run, &arguments, &[words]);
    }
}
