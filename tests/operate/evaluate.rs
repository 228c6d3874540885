//! `gyre evaluate` on the results of a run: the figures of a trajectory and of its covariances, as
//! a table, as JSON and drawn.

use std::{
    ffi::OsStr,
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use crate::common::{Ended, Run, gyre, python, recording};
use serde_json::Value;

/// A run of the small recording that is over.
fn run() -> Run {
    let run = Run::of_recording();
    run.complete();
    run
}

/// `gyre evaluate` on its trajectory.
fn evaluate(run: &Run) -> Command {
    let mut command = gyre();
    command
        .arg("evaluate")
        .arg("--estimate")
        .arg(run.out().join("trajectory.tum"));
    command
        .arg("--ground-truth")
        .arg(recording::small().join("gt/radar_odometry.csv"));
    command
}

fn with(mut command: Command, option: &str, value: impl AsRef<OsStr>) -> Command {
    command.arg(option).arg(value);
    command
}

fn json(mut command: Command) -> Value {
    command.arg("--json");
    serde_json::from_str(&Ended::of(command).succeeded().stdout).unwrap()
}

/// The run's odometry, changed, in a file of the test's own.
fn odometry(run: &Run, change: impl FnOnce(String) -> String) -> PathBuf {
    let path = run.folder().join("changed.csv");
    fs::write(&path, change(run.odometry())).unwrap();
    path
}

fn figure(value: &Value) -> f64 {
    value
        .as_f64()
        .unwrap_or_else(|| panic!("{value} is not a number"))
}

/// The figure of a statistic that a program of evo prints.
fn evo(program: &str, run: &Run, options: &[&str]) -> Option<f64> {
    let python = PathBuf::from(python());
    let program = python.with_file_name(program);
    let truth = run.out().join("ground_truth.tum");
    let mut command = Command::new(program);
    // evo writes its settings and logs into the home folder.
    command.env("HOME", run.folder()).arg("tum").arg(truth);
    command.arg(run.out().join("trajectory.tum")).args(options);
    if command.output().is_err() {
        println!("skipped: evo is not beside the Python that GYRE_PYTHON names");
        return None;
    }
    let printed = Ended::of(command).succeeded().stdout.clone();
    let line = printed
        .lines()
        .find_map(|line| line.trim().strip_prefix("rmse"));
    Some(line.unwrap().trim().parse().unwrap())
}

#[test]
#[ignore = ".ci/nightly: evo starts slowly, and often"]
fn evo_finds_the_same_errors_to_the_digit_it_shows() {
    let simulation = "[simulation]\nscans = 24\n[raster]\nn = 127\ncell_m = 0.8\n";
    let run = Run::configured(simulation);
    run.complete();
    let evaluation = &run.summary()["evaluation"];
    let pairs = ["--delta", "1", "--delta_unit", "f", "--pose_relation"];
    for (program, options, ours) in [
        ("evo_ape", vec!["--align"], &evaluation["ate"]["rmse_m"]),
        (
            "evo_rpe",
            [&pairs[..], &["trans_part"]].concat(),
            &evaluation["rpe"]["translation_rmse_m"],
        ),
        (
            "evo_rpe",
            [&pairs[..], &["angle_deg"]].concat(),
            &evaluation["rpe"]["rotation_rmse_deg"],
        ),
    ] {
        let Some(theirs) = evo(program, &run, &options) else {
            return;
        };
        // Six digits are shown, and stamps and poses in files are rounded.
        let ours = figure(ours);
        assert!((theirs - ours).abs() < 2e-6, "{program}: {theirs}, {ours}");
    }
}

#[test]
fn a_table_and_all_plots_come_of_an_odometry() {
    let run = run();
    let plots = run.folder().join("new/plots");
    let command = with(
        with(evaluate(&run), "--odometry", run.out().join("odometry.csv")),
        "--plots",
        &plots,
    );
    let ended = Ended::of(command);
    let table = &ended.succeeded().stdout;
    let rows_of = |motions: &str| {
        let row = |line: &&str| line.split_whitespace().take(2).eq([motions, "all"]);
        table.lines().filter(row).count()
    };
    assert_eq!(
        ["1", "4", "16", "64"].map(rows_of),
        [1, 1, 1, 0],
        "23 motions have no segment of 64:\n{table}"
    );
    for word in [
        "ATE",
        "covariance    23 motions",
        "first",
        "second",
        "times as much as their covariances say",
    ] {
        assert!(table.contains(word), "{word} is not in:\n{table}");
    }
    for plot in ["trajectory.svg", "errors.svg", "bands.svg"] {
        assert!(
            fs::read_to_string(plots.join(plot))
                .unwrap()
                .contains("<svg"),
            "{plot}"
        );
    }
}

#[test]
fn a_run_reports_the_same_as_its_evaluation() {
    let run = Run::of_recording();
    let ended = run.finish();
    assert!(
        ended
            .succeeded()
            .stdout
            .contains("covariance    23 motions"),
        "{}",
        ended.stdout
    );
    let (reported, evaluated) = (&run.summary()["evaluation"], json(evaluate(&run)));
    for place in [
        "/ate/rmse_m",
        "/nees/motions",
        "/nees/by_length/0/all/pose/ratio",
        "/nees/by_length/1/second_half/yaw/ratio",
        "/nees/by_length/2/all/translation/ratio",
    ] {
        let [reported, evaluated] =
            [reported, &evaluated].map(|json| figure(json.pointer(place).unwrap()));
        // files have so many decimals
        assert!(
            (reported / evaluated - 1.0).abs() < 1e-3,
            "{place}: {reported} and {evaluated}"
        );
    }
}

#[test]
fn two_halves_of_a_drive_are_judged_apart() {
    let run = run();
    let whole = json(evaluate(&run));
    let half = |part| json(with(evaluate(&run), "--nees-part", part));
    let halves = [half("0..50"), half("50..100")];
    let motions = halves
        .each_ref()
        .map(|half| half["nees"]["motions"].as_u64().unwrap());
    assert_eq!(motions.iter().sum::<u64>(), recording::SCANS as u64 - 1);
    for (half, name) in halves.iter().zip(["first_half", "second_half"]) {
        assert_eq!(
            half["ate"], whole["ate"],
            "the trajectory is judged as a whole"
        );
        let [alone, beside] = [
            &half["nees"]["by_length"][0]["all"],
            &whole["nees"]["by_length"][0][name],
        ];
        assert!(
            (figure(&alone["pose"]["ratio"]) - figure(&beside["pose"]["ratio"])).abs() < 1e-9,
            "{name}"
        );
    }
}

#[test]
fn an_odometry_with_a_column_missing_or_damaged_is_refused_in_a_sentence() {
    let run = run();
    let refused = |path: &Path, words: &[&str]| {
        Ended::of(with(evaluate(&run), "--odometry", path)).refused_with(words);
    };
    let missing = odometry(&run, |text| text.replacen("cov_yyaw", "spread", 1));
    refused(&missing, &["changed.csv", "no column cov_yyaw"]);
    let damaged = odometry(&run, |text| {
        let x_m = text
            .lines()
            .nth(1)
            .and_then(|row| row.split(',').nth(5))
            .unwrap();
        text.replacen(x_m, "far", 1)
    });
    refused(
        &damaged,
        &["changed.csv", "line: 2", "invalid float literal"],
    );
    let cut = odometry(&run, |text| text[..text.len() - 30].to_owned());
    refused(&cut, &["changed.csv", "line: 24", "31 fields"]);
    refused(&run.out().join("none.csv"), &["cannot read", "none.csv"]);
    refused(
        &run.out().join("trajectory.tum"),
        &["trajectory.tum: not an odometry.csv"],
    );
}

#[test]
fn an_odometry_of_another_drive_beside_the_trajectory_is_left_out_with_the_reason() {
    let run = run();
    fs::write(
        run.out().join("odometry.csv"),
        run.odometry().replace(",154713", ",154714"),
    )
    .unwrap();
    let ended = Ended::of(evaluate(&run));
    assert!(
        !ended.succeeded().stdout.contains("covariance"),
        "{}",
        ended.stdout
    );
    assert!(
        ended
            .stderr
            .contains("odometry.csv is not evaluated: its stamps are not the estimate's"),
        "{}",
        ended.stderr
    );
}

#[test]
fn a_part_that_is_none_is_refused() {
    let run = run();
    for part in ["60..50", "0..101", "half"] {
        let ended = Ended::of(with(evaluate(&run), "--nees-part", part));
        assert_eq!(ended.code(), Some(2));
        assert!(ended.stderr.contains("as in 0..50"), "{}", ended.stderr);
    }
}

#[test]
fn objects_are_evaluated_against_the_truth_of_their_recording() {
    let data = recording::around_a_block();
    let run = Run::small().data(data).set("objects.kind=tracks");
    run.complete();
    let against = |truth: &Path| {
        let mut command = gyre();
        command.args(["evaluate", "--objects"]).arg(run.out());
        command.arg(truth);
        Ended::of(command)
    };
    let printed = against(data);
    assert!(printed.succeeded().stdout.contains("precision"));
    let empty = tempfile::tempdir().unwrap();
    fs::write(empty.path().join("objects.csv"), "").unwrap();
    against(empty.path()).failed_with(&["ground_truth.tum"]);
}
