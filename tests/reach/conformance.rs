//! `gyre conformance`: Gyre's own stages keep the contract, and each breach of it is named.

mod stages;

use std::{env, process};

use gyre_stage::Launch;
use serde_json::Value;

use crate::common::{Ended, gyre, recording};
use stages::BREACH;

/// The report on a program, and the end of the command.
fn tested(stage: &str, more: &[&str]) -> (Value, Ended) {
    let mut command = gyre();
    command.args([
        "conformance",
        stage,
        "--json",
        "--scans",
        "8",
        "--set",
        "raster.n=63",
    ]);
    command
        .args(["--set", "masking.kind='threshold'"])
        .args(more);
    // The own source is tested with a simulation, of a small radar.
    if stage == "radar-replay" {
        command
            .args(["--set", "simulation.sensor.profile='cts350x-radiate'"])
            .args(["--set", "simulation.output.format='oxford'"]);
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

/// The sentences of a report about a rule.
fn why(report: &Value, rule: &str) -> String {
    judged(report, rule)["why"].to_string()
}

/// Asserts that a broken rotation search is found out by these rules, in sentences with these
/// words.
fn breaks(breach: &str, named: &[(&str, &str)]) {
    let report = broken("rotation-search", breach, &["--patience-s", "2"]);
    for (rule, words) in named {
        let why = why(&report, rule);
        assert!(why.contains(words), "{breach}: {rule}: {why}");
    }
}

/// In the process of a replaced stage: works as this stage.
#[test]
fn plays_a_broken_stage() {
    let Ok(breach) = env::var(BREACH) else {
        return;
    };
    let stage = if breach.starts_with("masking") {
        "masking"
    } else {
        "rotation-search"
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
    for stage in [
        "masking",
        "rotation-search",
        "translation-search",
        "joint-search",
        "refinement",
        "pose-integration",
    ] {
        conforms(stage, &["--same-as-own", "--budget-ms", "10000"]);
    }
}

#[test]
fn the_own_source_conforms() {
    conforms("radar-replay", &["--same-as-own"]);
}

#[test]
fn a_sink_with_keyframes_conforms() {
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
    assert!(
        report["own_work"]["p50_ms"].as_f64() > Some(0.0),
        "{report:#}"
    );
}

#[test]
fn an_item_that_is_skipped_is_named() {
    breaks("skips", &[("one-for-one", "it sent nothing about item 5")]);
}

#[test]
fn an_item_that_is_sent_twice_is_named() {
    breaks(
        "sends twice",
        &[("one-for-one", "it sent item 5 after item 5")],
    );
}

#[test]
fn an_end_that_is_kept_is_named() {
    breaks(
        "keeps the end",
        &[("passes-end", "has not passed on item 8")],
    );
}

#[test]
fn a_stage_that_leaves_at_the_end_is_named() {
    breaks(
        "leaves at the end",
        &[("passes-end", "it ended at the end of the stream")],
    );
}

#[test]
fn a_reader_without_handshake_is_named() {
    let named = ("asks-for-history", "without notifying `masked_handshake`");
    breaks("joins silently", &[named]);
}

#[test]
fn a_publisher_that_gives_no_history_is_named() {
    let named = ("gives-history", "received 0 of the last 5 items");
    breaks("gives no history", &[named]);
}

#[test]
fn results_that_differ_from_time_to_time_are_named() {
    let in_steps = ("deterministic", "item 0 has other bytes");
    breaks(
        "is not deterministic",
        &[in_steps, ("resumes", "has other bytes after kill -9")],
    );
}

#[test]
fn malformed_inputs_that_are_swallowed_are_named() {
    let named = (
        "refuses-malformed",
        "it goes on after an item on `masked` with an unknown flag",
    );
    breaks("swallows", &[named]);
}

#[test]
fn items_without_stamps_or_identity_are_named() {
    let stamps = ("stamps-work", "item 0: received_ns of its own hop is 0");
    let copy = ("copies-item", "item 0: stamp_ns is not that of the input");
    breaks("stamps nothing and forgets the item", &[stamps, copy]);
}

#[test]
fn work_that_is_not_in_the_stamps_does_not_pass_a_budget() {
    let report = broken("rotation-search", "hides its work", &["--budget-ms", "100"]);
    let why = why(&report, "keeps-budget");
    assert!(why.contains("by our clock"), "{why}");
    assert!(!why.contains("by its own stamps"), "{why}");
}

#[test]
fn a_field_that_breaks_its_rule_is_named() {
    let named = (
        "sends-valid",
        "item 5 cannot be read by any stage: angle_rad is NaN",
    );
    breaks("sends NaN", &[named]);
}

#[test]
fn a_stage_that_needs_all_items_is_named() {
    let named = ("looks-back", "it came to no item and not to item 8");
    breaks("needs the first item", &[named]);
}

#[test]
fn a_stage_that_hangs_on_a_request_to_stop_is_named() {
    let more = ["--patience-s", "2", "--stop-timeout-s", "0.5"];
    let why = why(
        &broken("rotation-search", "hangs", &more),
        "stops-on-request",
    );
    assert!(why.contains("has not exited within"), "{why}");
    assert!(why.contains("in the middle of the stream"), "{why}");
}

#[test]
fn a_stage_that_says_it_stands_by_and_does_not_wait_is_named() {
    let named = ("stands-by", "before its standard input ends");
    breaks("does not wait", &[named]);
}

#[test]
fn masking_that_waits_for_too_little_is_named() {
    masking_breaks("masking impatient", "before the motion of item 1 was there");
}

#[test]
fn masking_that_waits_for_too_much_is_named() {
    masking_breaks(
        "masking too patient",
        "waits for more than the motion 2 items before",
    );
}

fn masking_breaks(breach: &str, words: &str) {
    let report = broken("masking", breach, &["--patience-s", "2"]);
    let why = why(&report, "waits-for-motion");
    assert!(why.contains(words), "{breach}: {why}");
}

#[test]
fn a_command_that_cannot_be_tested_is_refused_in_a_sentence() {
    let refused = |arguments: &[&str], words: &[&str]| {
        let mut command = gyre();
        command.arg("conformance").args(arguments);
        let ended = Ended::of(command);
        assert_eq!(ended.code(), Some(2), "{}", ended.stderr);
        assert_eq!(ended.stdout, "");
        let sentence = ended.stderr.strip_prefix("gyre: ").unwrap();
        assert_eq!(sentence.lines().count(), 1, "{sentence}");
        assert!(
            words.iter().all(|word| sentence.contains(word)),
            "{sentence}"
        );
    };
    refused(
        &["masking", "--command", "python3 'x"],
        &["--command", "quotes"],
    );
    refused(
        &["masking", "--patience-s", "nan"],
        &["--patience-s", "0 or more"],
    );
    refused(&["masking", "no.toml"], &["no.toml"]);
}
