//! `gyre evaluate` on the results of a run: the figures of a trajectory and of its covariances, as
//! a table, as JSON and drawn.

use std::{
    env,
    ffi::OsStr,
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use crate::{
    PROGRAM, PROJECT,
    common::{Ended, Run, can, finished, gyre, python, recording},
    reach::only_if,
};
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
    let truth = recording::small().join("gt/radar_odometry.csv");
    command
        .arg("evaluate")
        .arg(run.out().join("trajectory.tum"))
        .arg(truth);
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

fn figure(value: &Value) -> f64 {
    value
        .as_f64()
        .unwrap_or_else(|| panic!("{value} is not a number"))
}

#[test]
#[ignore = ".ci/nightly: evo starts slowly, and often"]
fn evo_finds_the_same_errors_to_the_digit_it_shows() {
    let evo = PathBuf::from(python()).with_file_name("evo_ape");
    only_if!(can(&[evo.to_str().unwrap(), "--help"]));
    let simulation = "[simulation]\nscans = 24\n[raster]\nn = 127\ncell_m = 0.8\n";
    let run = Run::configured(simulation);
    run.complete();
    let mut script = Command::new(format!("{PROJECT}/examples/evo.sh"));
    let [evo, own] = [evo.as_path(), Path::new(PROGRAM)].map(|it| it.parent().unwrap().display());
    let path = format!("{evo}:{own}:{}", env::var("PATH").unwrap());
    // evo writes its settings and logs into the home folder.
    script
        .arg(run.out())
        .env("PATH", path)
        .env("HOME", run.folder());
    let printed = Ended::of(script).succeeded().stdout.clone();
    let rmse = printed
        .lines()
        .filter_map(|line| line.trim().strip_prefix("rmse"));
    let theirs: Vec<f64> = rmse.take(3).map(|it| it.trim().parse().unwrap()).collect();
    let evaluation = &run.summary()["evaluation"];
    let (ate, rpe) = (&evaluation["ate"]["rmse_m"], &evaluation["rpe"]);
    let ours = [ate, &rpe["translation_rmse_m"], &rpe["rotation_rmse_deg"]].map(figure);
    assert_eq!(theirs.len(), ours.len(), "{printed}");
    for (theirs, ours) in theirs.iter().zip(ours) {
        // Six digits are shown, and stamps and poses in files are rounded.
        assert!((theirs - ours).abs() < 2e-6, "{theirs}, {ours}");
    }
}

#[test]
fn without_a_ground_truth_a_run_is_compared_with_itself() {
    for (threshold, code, word) in [("60", 0, "good"), ("90", 1, "BAD: threshold")] {
        let run = Run::of_recording().set(&format!("masking.threshold={threshold}"));
        run.complete();
        let ended = finished!["evaluate", "--alone", run.out()];
        assert_eq!(ended.status.code(), Some(code), "{ended:?}");
        let verdict = ended.stdout.lines().last().unwrap();
        let verdict = verdict.trim_start_matches("verdict").trim();
        assert!(verdict.starts_with(word), "{ended:?}");
        // The drive is too short for the constants.
        assert!(verdict.contains("not determined: constants"), "{ended:?}");
        finished!["evaluate", "--alone", "--json", run.out()]
            .failed_with(&["leave out the options"]);
    }
}

#[test]
fn a_table_and_all_plots_come_of_an_odometry() {
    let run = run();
    let plots = run.folder().join("new/plots");
    let odometry = run.out().join("odometry.csv");
    let command = with(evaluate(&run), "--odometry", odometry);
    let ended = Ended::of(with(command, "--plots", &plots));
    let table = &ended.succeeded().stdout;
    let rows_of = |motions: &str| {
        let row = |line: &&str| line.split_whitespace().take(2).eq([motions, "all"]);
        table.lines().filter(row).count()
    };
    // 23 motions have no segment of 64.
    let rows = ["1", "4", "16", "64"].map(rows_of);
    assert_eq!(rows, [1, 1, 1, 0], "{table}");
    let words =
        "ATE,covariance    23 motions,first,second,times as much as their covariances state";
    for word in words.split(',') {
        assert!(table.contains(word), "{word} is not in:\n{table}");
    }
    for plot in ["trajectory.svg", "errors.svg", "bands.svg"] {
        let drawn = fs::read_to_string(plots.join(plot)).unwrap();
        assert!(drawn.contains("<svg"), "{plot}");
    }
}

#[test]
fn a_run_reports_the_same_as_its_evaluation() {
    let run = Run::of_recording();
    run.finish().succeeded().prints("covariance    23 motions");
    let (reported, evaluated) = (&run.summary()["evaluation"], json(evaluate(&run)));
    for place in [
        "/ate/rmse_m",
        "/nees/motions",
        "/nees/by_length/0/all/pose/ratio",
        "/nees/by_length/1/second_half/yaw/ratio",
        "/nees/by_length/2/all/translation/ratio",
    ] {
        let at = |json: &Value| figure(json.pointer(place).unwrap());
        // files have so many decimals
        let ratio = at(reported) / at(&evaluated);
        assert!((ratio - 1.0).abs() < 1e-3, "{place}: {ratio}");
    }
    // A part of the drive is judged apart, and the trajectory as a whole.
    let half = json(with(evaluate(&run), "--nees-part", "50..100"));
    assert_eq!(half["ate"], evaluated["ate"]);
    let lengths = [&half, &evaluated].map(|it| &it["nees"]["by_length"][0]);
    let ratio = |of: &Value, part: &str| figure(&of[part]["pose"]["ratio"]);
    let difference = ratio(lengths[0], "all") - ratio(lengths[1], "second_half");
    assert!(difference.abs() < 1e-9, "{difference}");
}

#[test]
fn what_is_no_odometry_is_refused_and_one_of_another_drive_is_left_out_with_the_reason() {
    let run = run();
    for (name, words) in [
        ("none.csv", ["cannot read", "none.csv"]),
        ("trajectory.tum", ["trajectory.tum", "not an odometry.csv"]),
    ] {
        let path = run.out().join(name);
        Ended::of(with(evaluate(&run), "--odometry", path)).refused_with(&words);
    }
    let other = run.odometry().replace(",154713", ",154714");
    fs::write(run.out().join("odometry.csv"), other).unwrap();
    let ended = Ended::of(evaluate(&run));
    let said = &ended.succeeded().stdout;
    assert!(!said.contains("covariance"), "{said}");
    let reason = "odometry.csv is not evaluated: its stamps are not the estimate's";
    ended.says(reason);
}

#[test]
fn objects_are_evaluated_against_the_truth_of_their_recording() {
    let data = recording::around_a_block();
    let run = Run::small().data(data).set("objects.kind=tracks");
    run.complete();
    let against = |truth: &Path| finished!["evaluate", "--objects", run.out(), truth];
    against(data).succeeded().prints("precision");
    let empty = tempfile::tempdir().unwrap();
    fs::write(empty.path().join("objects.csv"), "").unwrap();
    against(empty.path()).failed_with(&["ground_truth.tum"]);
}
