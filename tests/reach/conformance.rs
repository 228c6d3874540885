//! `gyre conformance`: Gyre's own stages keep the contract, and each breach of it is named.

mod stages;

use std::{env, process, thread};

use gyre_contract::StageId;
use gyre_stage::Launch;
use serde_json::Value;

use crate::common::{Ended, finished, gyre, recording};
use stages::BREACH;

/// The report on a program, and the end of the command.
fn tested(stage: &str, more: &[&str]) -> (Value, Ended) {
    let mut command = gyre();
    command.args(["conformance", stage, "--json", "--scans", "8"]);
    command.args(["--set", "raster.n=63", "--set", "masking.kind='threshold'"]);
    command.args(more);
    // The own source is tested with a simulation, of a small radar.
    if stage == "radar-replay" {
        command.args(["--set", "simulation.sensor.profile='cts350x-radiate'"]);
        command.args(["--set", "simulation.output.format='oxford'"]);
    } else {
        command.arg(recording::small());
    }
    if !more.contains(&"--stop-timeout-s") {
        command.args(["--stop-timeout-s", "30"]);
    }
    let ended = Ended::of(command);
    let report = serde_json::from_str(&ended.stdout);
    (report.unwrap_or_else(|_| panic!("{}", ended.stderr)), ended)
}

fn conforms(stage: &str, more: &[&str]) {
    let (report, ended) = tested(stage, more);
    let rules = report["rules"].as_array().unwrap();
    let not_kept = |rule: &&Value| {
        !["kept", "does-not-apply"]
            .iter()
            .any(|it| rule["verdict"] == *it)
    };
    let breaches: Vec<_> = rules.iter().filter(not_kept).collect();
    assert_eq!(ended.code(), Some(0), "{breaches:#?}");
    let kept = rules.iter().filter(|rule| rule["verdict"] == "kept");
    assert!(kept.count() >= 14, "{report:#}");
    assert_eq!(judged(&report, "stands-by")["verdict"], "kept");
}

/// Returns the verdict of a report on a rule.
fn judged<'a>(report: &'a Value, rule: &str) -> &'a Value {
    let rules = report["rules"].as_array().unwrap();
    rules.iter().find(|judged| judged["rule"] == rule).unwrap()
}

/// The command of a stage that breaks the contract so; `none` keeps it.
pub fn command(breach: &str) -> String {
    let program = env::current_exe().unwrap();
    format!(
        "env {BREACH}='{breach}' '{}' --exact reach::conformance::plays_a_broken_stage --nocapture",
        program.display()
    )
}

/// The report on a stage that breaks the contract so.
fn broken(stage: &str, breach: &str, more: &[&str]) -> Value {
    let (report, ended) = tested(stage, &[&["--command", &command(breach)], more].concat());
    assert_eq!(ended.code(), Some(1), "{report:#}");
    report
}

fn why(report: &Value, rule: &str) -> String {
    judged(report, rule)["why"].to_string()
}

/// In the process of a replaced stage: works as this stage.
#[test]
fn plays_a_broken_stage() {
    let Ok(breach) = env::var(BREACH) else {
        return;
    };
    let stage = match breach.starts_with("masking") {
        true => "masking",
        false => "rotation-search",
    };
    let worked = Launch::from_environment(stage).and_then(|launch| stages::play(&launch, &breach));
    if let Err(error) = worked {
        eprintln!("{error}");
        process::exit(error.exit_code().into());
    }
    process::exit(0);
}

#[test]
fn own_stages_conform_and_are_their_own_equals() {
    let equals = ["--same-as-own", "--budget-ms", "10000"];
    for stage in StageId::ALL.map(StageId::name) {
        // A source answers no items.
        let more = if stage == "radar-replay" { 1 } else { 3 };
        conforms(stage, &equals[..more]);
    }
    conforms("pose-integration", &["--set", "slam.kind='graph'"]);
}

#[test]
fn a_stage_without_results_conforms_but_for_the_results() {
    let (report, ended) = tested(
        "rotation-search",
        &["--command", &command("none"), "--same-as-own"],
    );
    assert_eq!(ended.code(), Some(1));
    let rules = report["rules"].as_array().unwrap();
    let broken = rules.iter().filter(|rule| rule["verdict"] == "broken");
    let broken: Vec<_> = broken.map(|rule| rule["rule"].as_str().unwrap()).collect();
    assert_eq!(broken, ["same-as-own"], "{report:#}");
    let stands_by = judged(&report, "stands-by");
    assert_eq!(stands_by["verdict"], "does-not-apply", "{stands_by}");
    assert!(why(&report, "stands-by").contains("--cold"), "{stands_by}");
}

/// A stage, its breach, the rule that names it, and words of the sentence.
#[rustfmt::skip]
static BREACHES: [(&str, &str, &str, &str); 18] = [
    (SEARCH, "skips", "one-for-one", "it sent nothing about item 5"),
    (SEARCH, "sends twice", "one-for-one", "it sent item 5 after item 5"),
    (SEARCH, "keeps the end", "passes-end", "has not passed on item 8"),
    (SEARCH, "leaves at the end", "passes-end", "it ended at the end of the stream"),
    (SEARCH, "joins silently", "asks-for-history", "without notifying `masked_handshake`"),
    (SEARCH, "gives no history", "gives-history", "received 0 of the last 5 items"),
    (SEARCH, "is not deterministic", "deterministic", "item 0 has other bytes"),
    (SEARCH, "is not deterministic", "resumes", "has other bytes after kill -9"),
    (SEARCH, "swallows", "refuses-malformed", "on `masked` with an unknown flag"),
    (SEARCH, "stamps nothing", "stamps-work", "item 0: received_ns of its own hop is 0"),
    (SEARCH, "forgets the item", "copies-item", "stamp_ns differs from the input"),
    (SEARCH, "sends NaN", "sends-valid", "read by any stage: rotation.angle_rad is NaN"),
    (SEARCH, "needs the first item", "looks-back", "it came to no item and not to item 8"),
    (SEARCH, "hangs", "stops-on-request", "of SIGTERM in the middle of the stream"),
    (SEARCH, "hides its work", "keeps-budget", "by our clock"),
    (SEARCH, "does not wait", "stands-by", "before its standard input ends"),
    ("masking", "masking impatient", WAITS, "before the motion of item 1 was there"),
    ("masking", "masking too patient", WAITS, "for more than the motion 2 items before"),
];
const SEARCH: &str = "rotation-search";
const WAITS: &str = "waits-for-motion";

#[test]
fn each_breach_of_the_contract_is_named() {
    let examine = |(stage, breach, rule, words): (&str, &str, &str, &str)| {
        let mut more = vec!["--patience-s", "2"];
        if breach == "hangs" {
            more.extend(["--stop-timeout-s", "0.5"]);
        }
        if rule == "keeps-budget" {
            more.extend(["--budget-ms", "100"]);
        }
        let why = why(&broken(stage, breach, &more), rule);
        assert!(why.contains(words), "{breach}: {rule}: {why}");
    };
    // Two at once: more would be late on a small machine.
    thread::scope(|scope| {
        let (first, second) = BREACHES.split_at(BREACHES.len() / 2);
        for half in [first, second] {
            scope.spawn(move || half.iter().for_each(|it| examine(*it)));
        }
    });
}

#[test]
fn a_command_that_cannot_be_tested_is_refused_in_a_sentence() {
    let refused = |arguments: &[&str], words: &[&str]| {
        let ended = finished!["conformance"; arguments];
        assert_eq!(ended.code(), Some(2), "{}", ended.stderr);
        let sentence = ended.stderr.strip_prefix("gyre: ").unwrap();
        assert_eq!((sentence.lines().count(), ended.stdout.as_str()), (1, ""));
        assert!(words.iter().all(|it| sentence.contains(it)), "{sentence}");
    };
    let unclosed = ["masking", "--command", "python3 'x"];
    refused(&unclosed, &["--command", "quotes"]);
    refused(&["masking", "no.toml"], &["no.toml"]);
}
