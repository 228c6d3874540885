//! `gyre-lab tables` and `gyre-lab ablation` as a whole: a small simulated drive, real runs, and a
//! baseline that only pretends.

use std::{fs, path::Path, process::Command};

use serde_json::Value;
use tempfile::TempDir;

use crate::{
    common::{Ended, folder, gyre, recording, runtime_is_installed},
    gyre_lab,
};

const SIZE: usize = 63;
const ROWS: [&str; 7] = [
    "raw",
    "f-raw, line 14",
    "f-raw, Eq. 7",
    "Gyre, every angle",
    "Gyre, search alone",
    "Gyre, refined",
    "Gyre",
];

/// Writes what a baseline writes, to the file that follows `--json`: 80 ms for each search,
/// whatever its arguments.
const BASELINE: &str = r#"
echo "$@" > "$(dirname "$0")/arguments.txt"
while [ "$1" != --json ]; do shift; done
echo '{"torch": "0.0", "threads": 1, "rows": [
  {"n": 63, "row": "mask", "median_ms": 5.0}, {"n": 63, "row": "raw", "median_ms": 80.0},
  {"n": 63, "row": "f-raw", "median_ms": 80.0}, {"n": 63, "row": "f-raw-eq7", "median_ms": 80.0}]}' > "$2"
"#;

/// Puts a model of the tests of masking into a folder's `models`.
fn install(folder: &Path, fixture: &str, name: &str) {
    let (from, to) = (
        Path::new(crate::PROJECT).join("shared/method/masking/tests/models"),
        folder.join("models"),
    );
    fs::create_dir_all(&to).unwrap();
    fs::copy(
        from.join(format!("{fixture}.onnx")),
        to.join(format!("{fixture}.onnx")),
    )
    .unwrap();
    fs::copy(
        from.join(format!("{fixture}.toml")),
        to.join(format!("{name}.toml")),
    )
    .unwrap();
}

fn read(folder: &Path, name: &str) -> Value {
    serde_json::from_str(&fs::read_to_string(folder.join("out").join(name)).unwrap()).unwrap()
}

fn lab_folder() -> TempDir {
    let folder = folder();
    fs::write(folder.path().join("baseline.sh"), BASELINE).unwrap();
    folder
}

/// A command of `gyre-lab` on the small recording.
fn lab(folder: &Path, name: &str) -> Command {
    let mut command = gyre_lab();
    command.current_dir(folder);
    command.args([name, "--config", "small.toml", "--out", "out", "--data"]);
    command.arg(recording::small());
    command
}

/// `gyre-lab tables` with little to time.
fn tables(folder: &Path) -> Command {
    let mut command = lab(folder, "tables");
    command.args(["--passes", "1"]);
    command
}

/// `gyre-lab ablation` of the small recording with two rasters.
fn ablation(folder: &Path) -> Command {
    fs::write(
        folder.join("wide.toml"),
        "[raster]\nn = 127\ncell_m = 1.0\n",
    )
    .unwrap();
    let mut command = lab(folder, "ablation");
    command
        .args(["--config", "wide.toml", "--data"])
        .arg(recording::small());
    command
}

fn line<'a>(lines: &'a Value, row: &str) -> &'a Value {
    lines
        .as_array()
        .unwrap()
        .iter()
        .find(|line| line["row"] == row)
        .unwrap_or_else(|| panic!("no {row} in {lines:#}"))
}

#[test]
fn both_tables_are_filled_and_their_commands_repeat_the_runs() {
    let folder = lab_folder();
    let mut command = tables(folder.path());
    command.args(["--sizes", &SIZE.to_string()]);
    command.args(["--baseline", "sh", "--baseline-script", "baseline.sh"]);
    let ended = Ended::of(command);
    ended.succeeded();
    let text = |name: &str| fs::read_to_string(folder.path().join(name)).unwrap();
    assert_eq!(text("out/tables.md"), ended.stdout);
    let json = read(folder.path(), "tables.json");

    let times = &json["tables"][0]["rows"];
    for row in ROWS {
        assert!(line(times, row)["ms"].as_f64().unwrap() > 0.0, "{row}");
    }
    assert_eq!(line(times, "f-raw, line 14")["baseline_ms"], 80.0);
    let mask = line(times, "mask");
    assert_eq!(
        (&mask["ms"], &mask["baseline_ms"]),
        (&Value::Null, &Value::from(5.0))
    );
    assert_eq!(
        text("arguments.txt").trim(),
        "--threads 1 --sizes 63 --passes 2 --rotations 31 --json out/baseline-63.json"
    );

    let accuracy = &json["tables"][1]["rows"];
    for row in ROWS {
        let figures = line(accuracy, row);
        let [path, ate, search] =
            ["path_m", "ate/rmse_m", "search_ms"].map(|key| figures[key].as_f64().unwrap());
        assert!(
            path > 40.0 && ate < 0.05 * path && search > 0.0,
            "{row}: {figures:#}"
        );
    }
    assert_eq!(line(accuracy, "f-raw, Eq. 7")["paper_percent"], 8.46);
    repeats(folder.path(), line(accuracy, "f-raw, line 14"));

    // Without networks there is what the paper and the baseline say, and what is missing.
    for row in ["mbym", "f-mbym, Eq. 7"] {
        assert_eq!(line(accuracy, row)["command"], Value::Null);
        assert!(line(times, row)["ms"].is_null());
    }
    for lines in [times, accuracy] {
        let mut rows = lines.as_array().unwrap().iter();
        assert!(!rows.any(|line| line["row"] == "Gyre, masked"), "{lines:#}");
    }
    for reason in [
        "mask at 63; mbym at 63; f-mbym, Eq. 7 at 63: there is no models/f-mbym-63.toml. ",
        "mbym; f-mbym, Eq. 7: there is no models/f-mbym-255.toml. ",
        "Gyre, search alone, masked; Gyre, masked: there is no models/gyre-255.toml.\n",
    ] {
        assert!(
            ended.stdout.contains(reason),
            "{reason} is not in {}",
            ended.stdout
        );
    }
}

#[test]
#[ignore = ".ci/nightly: both tables with each network"]
fn masked_rows_are_timed_and_run_with_the_networks_that_there_are() {
    if !runtime_is_installed() {
        return;
    }
    let folder = lab_folder();
    for (fixture, name) in [
        ("pair-127", "f-mbym-127"),
        ("pair-255", "f-mbym-255"),
        ("single-127", "gyre-255"),
    ] {
        install(folder.path(), fixture, name);
    }
    let mut command = tables(folder.path());
    command.args(["--sizes", "127,31"]);
    let ended = Ended::of(command);
    ended.succeeded();
    let json = read(folder.path(), "tables.json");
    let masked = [
        "mbym",
        "f-mbym, Eq. 7",
        "Gyre, search alone, masked",
        "Gyre, masked",
    ];

    let times = &json["tables"][0]["rows"];
    for row in masked.iter().chain(&["mask", "mask, default"]) {
        let ours = line(times, row);
        let [ms, cell_m] = ["ms", "cell_m"].map(|key| ours[key].as_f64().unwrap());
        assert!(ms > 0.0 && (cell_m - 0.8).abs() < 1e-6, "{row}");
    }
    let ms = |row: &str| line(times, row)["ms"].as_f64().unwrap();
    assert!(ms("mask") < ms("mbym"), "{times:#}");
    assert_eq!(line(times, "mbym")["mask"], "models/f-mbym-127.toml");
    assert!(
        ended.stdout.contains("models/gyre-255.toml is for 127"),
        "{}",
        ended.stdout
    );

    let accuracy = &json["tables"][1]["rows"];
    let ate = |row: &str| line(accuracy, row)["ate/rmse_m"].clone();
    for row in masked {
        assert!(
            line(accuracy, row)["masking_ms"].as_f64().unwrap() > 0.0,
            "{row}"
        );
        assert_ne!(ate(row), ate("Gyre, search alone"), "{row}");
    }
    for row in ["f-mbym, Eq. 7", "Gyre, masked"] {
        repeats(folder.path(), line(accuracy, row));
    }
}

#[test]
#[ignore = ".ci/nightly: many runs"]
fn an_ablation_has_a_learned_mask_where_the_network_fits_the_raster() {
    if !runtime_is_installed() {
        return;
    }
    let folder = lab_folder();
    install(folder.path(), "single-127", "gyre-255");
    let ended = Ended::of(ablation(folder.path()));
    ended.succeeded();
    let json = read(folder.path(), "ablation.json");
    let [small, wide] = [0, 1].map(|sequence| json["tables"][sequence]["rows"].as_array().unwrap());
    assert_eq!((small.len(), wide.len()), (10, 9));
    assert_eq!(small[5]["row"], "6 learned mask");
    assert_ne!(small[5]["ate/rmse_m"], small[4]["ate/rmse_m"]);
    let is_masked = |step: &Value| {
        step["command"]
            .as_str()
            .unwrap()
            .contains("masking.kind=learned")
    };
    let masked: Vec<bool> = small.iter().map(is_masked).collect();
    assert_eq!(masked, [[false; 5], [true; 5]].concat());
    let reason = "Left out. learned mask: raster.cell_m is 1";
    assert!(ended.stdout.contains(reason), "{}", ended.stdout);
}

#[test]
#[ignore = ".ci/nightly: many runs"]
fn an_ablation_leads_from_the_papers_form_to_each_sequences_own_configuration() {
    let folder = lab_folder();
    let ended = Ended::of(ablation(folder.path()));
    ended.succeeded();
    let json = read(folder.path(), "ablation.json");
    let [small, wide] = [0, 1].map(|sequence| json["tables"][sequence]["rows"].as_array().unwrap());
    assert_eq!((small.len(), wide.len()), (9, 9));
    for step in small.iter().chain(wide) {
        let [path, ate] = ["path_m", "ate/rmse_m"].map(|key| step[key].as_f64().unwrap());
        assert!(path > 40.0 && ate < 0.05 * path, "{step:#}");
        let line = format!("| {} | ", step["row"].as_str().unwrap());
        assert!(ended.stdout.contains(&line), "{line}: {}", ended.stdout);
    }
    let ates = |steps: &[Value]| {
        steps
            .iter()
            .map(|step| step["ate/rmse_m"].clone())
            .collect::<Vec<_>>()
    };
    // The same raster up to the step to their own.
    assert_eq!(ates(&small[..3]), ates(&wide[..3]));
    assert_ne!(ates(&small[3..4]), ates(&wide[3..4]));
    let own = small[8]["command"].as_str().unwrap();
    assert!(!own.contains("--set"), "{own}");
}

#[test]
fn single_changes_are_run_alone() {
    let folder = lab_folder();
    let mut command = lab(folder.path(), "ablation");
    command.args(["--vary", "masking.threshold=50,70"]);
    Ended::of(command).succeeded();
    let json = read(folder.path(), "ablation.json");
    let lines = json["tables"][0]["rows"].as_array().unwrap();
    let rows: Vec<&Value> = lines.iter().map(|line| &line["row"]).collect();
    assert_eq!(
        rows,
        ["as it is", "masking.threshold=50", "masking.threshold=70"]
    );
    let sets = |row: &Value| row["command"].as_str().unwrap().matches("--set").count();
    assert_eq!(lines.iter().map(sets).collect::<Vec<_>>(), [0, 1, 1]);
    let ate = |row: &Value| row["ate/rmse_m"].as_f64().unwrap();
    assert_ne!(ate(&lines[1]), ate(&lines[2]));
}

/// Asserts that the command of a line, in another folder for its results, gives what it gave in the
/// table.
fn repeats(folder: &Path, line: &Value) {
    let words: Vec<&str> = line["command"].as_str().unwrap().split(' ').collect();
    let out = words[1 + words.iter().position(|word| *word == "--out").unwrap()];
    let mut again = gyre();
    let elsewhere = words[1..]
        .iter()
        .map(|word| if *word == out { "again" } else { word });
    again.current_dir(folder).args(elsewhere);
    Ended::of(again).succeeded();
    let odometry = |out: &str| fs::read_to_string(folder.join(out).join("odometry.csv")).unwrap();
    assert_eq!(odometry(out), odometry("again"));
}

#[test]
fn what_cannot_be_measured_is_refused_before_anything_is() {
    let folder = lab_folder();
    let refused = |arguments: &[&str], words: &[&str]| {
        let mut command = tables(folder.path());
        command.args(arguments);
        Ended::of(command).refused_with(words);
    };
    let data = recording::small().to_str().unwrap();
    refused(&["--data", "/elsewhere"], &["1 --config but 2 --data"]);
    refused(
        &["--config", "small.toml", "--data", data],
        &["would write to the same folder"],
    );
    refused(
        &["--sizes", "63,8"],
        &["raw at 8 cells a side", "16 to 8192"],
    );
    let failing = [
        "--sizes",
        "63",
        "--baseline",
        "sh",
        "--baseline-script",
        "none.sh",
    ];
    refused(&failing, &["the baseline none.sh failed: ", "none.sh"]);
}
