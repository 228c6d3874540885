//! `gyre stress`: verdicts, exit codes, and what a measurement must not hide.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Output,
};

use serde_json::Value;
use tempfile::TempDir;

use crate::common::{assert_nothing_left, gyre};

/// Time between two scans of a simulated radar, s.
const PERIOD_S: f64 = 0.25;

/// A stress test of a small simulated drive.
struct Stress {
    folder: TempDir,
}

impl Stress {
    fn new() -> Self {
        let folder = tempfile::Builder::new()
            .prefix("gyre-test-")
            .tempdir()
            .unwrap();
        let configuration = "[simulation]\nscans = 24\n[raster]\nn = 127\ncell_m = 0.8\n";
        fs::write(folder.path().join("small.toml"), configuration).unwrap();
        Self { folder }
    }

    fn out(&self) -> PathBuf {
        self.folder.path().join("out")
    }

    fn run(&self, words: &[&str]) -> Output {
        let output = gyre()
            .arg("stress")
            .arg(self.folder.path().join("small.toml"))
            .arg("--out")
            .arg(self.out())
            .args(words)
            .output()
            .unwrap();
        println!("{}", String::from_utf8_lossy(&output.stderr));
        output
    }

    /// The outcome of the first scenario.
    fn outcome(&self) -> Value {
        let text = fs::read_to_string(self.out().join("report.json")).unwrap();
        let report: Value = serde_json::from_str(&text).unwrap();
        report["outcomes"][0].clone()
    }

    fn assert_nothing_left(&self, run: &str) {
        assert_nothing_left(&self.out().join("runs").join(run));
    }
}

fn exists(folder: &Path, names: &[&str]) {
    for name in names {
        assert!(folder.join(name).exists(), "{name} is missing");
    }
}

fn ms(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value}"))
}

#[test]
fn a_generous_budget_is_kept_and_an_impossible_one_is_named() {
    let stress = Stress::new();
    let steady = ["--scenario", "steady", "--duration", "3"];
    let kept = [&steady[..], &["--set", "budget.max_ms=60000"]].concat();
    assert_eq!(stress.run(&kept).status.code(), Some(0));
    let files = [
        "report.md",
        "report.json",
        "report.svg",
        "steady.svg",
        "steady.csv",
        "config.toml",
    ];
    exists(&stress.out(), &files);
    let outcome = stress.outcome();
    assert_eq!(outcome["verdict"], "passed");
    let counts = &outcome["figures"]["counts"];
    assert_eq!(counts["due"], 12, "{counts}");
    let processes = outcome["figures"]["processes"].as_array().unwrap();
    assert!(processes.iter().any(|cost| cost["name"] == "masking"));
    let missed = [&steady[..], &["--set", "budget.steady.p50_ms=0.001"]].concat();
    let output = stress.run(&missed);
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(said.contains("steady: FAILED; p50_ms"), "{said}");
    assert!(said.contains("limit 0.001"), "{said}");
    stress.assert_nothing_left("steady");
}

#[test]
fn a_source_that_is_stopped_shows_in_sensor_to_pose_although_its_service_time_hides_it() {
    let stress = Stress::new();
    let words = [
        "--scenario",
        "stopped",
        "--stage",
        "radar-replay",
        "--duration",
        "6",
    ];
    assert_eq!(stress.run(&words).status.code(), Some(0));
    let figures = &stress.outcome()["figures"];
    assert_eq!(figures["faults"][0]["stage"], "radar-replay");
    let open = ms(&figures["sensor_to_pose"]["max_ms"]);
    let closed = ms(&figures["closed_loop"]["max_ms"]);
    // It is stopped for 1 s, of which up to a period passes before the next scan is due.
    assert!(open >= 1e3 * (1.0 - PERIOD_S), "{open} ms");
    assert!(closed < 0.7 * open, "{closed} ms of {open} ms");
    assert!(figures["counts"]["dropped"].as_u64() > Some(0));
    assert_eq!(figures["counts"]["due"], 24);
}

#[test]
fn the_sensors_clock_goes_on_while_its_source_is_dead() {
    let stress = Stress::new();
    let words = [
        "--scenario",
        "kills",
        "--stage",
        "radar-replay",
        "--duration",
        "6",
    ];
    assert_eq!(stress.run(&words).status.code(), Some(0));
    let figures = &stress.outcome()["figures"];
    assert_eq!(figures["restarts"]["radar-replay"], 1);
    assert!(ms(&figures["faults"][0]["recovery_ms"]) > 0.0);
    let csv = fs::read_to_string(stress.out().join("kills.csv")).unwrap();
    let due_s: Vec<f64> = csv
        .lines()
        .skip(1)
        .map(|line| line.split(',').next().unwrap().parse().unwrap())
        .collect();
    for pair in due_s.windows(2) {
        let gap_s = pair[1] - pair[0];
        assert!((gap_s - PERIOD_S).abs() < 0.01, "{gap_s} s in {due_s:?}");
    }
    stress.assert_nothing_left("kills");
}

#[test]
fn a_test_that_cannot_be_carried_out_is_no_verdict() {
    let stress = Stress::new();
    let output = stress.run(&["--data", "nowhere", "--scenario", "steady"]);
    assert_eq!(output.status.code(), Some(2));
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        said.starts_with("gyre stress: ") && said.contains("nowhere"),
        "{said}"
    );
    let output = stress.run(&["--set", "budget.stedy.p50_ms=1", "--scenario", "steady"]);
    assert_eq!(output.status.code(), Some(2));
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.contains("did you mean `steady`?"), "{said}");
}
