//! `gyre-lab tables` as a whole: a small simulated drive, real runs, and a peer that only pretends.

use std::{fs, path::Path, process::Command};

use crate::common::{Ended, gyre, recording};
use gyre_masking::runtime;
use serde_json::Value;
use tempfile::TempDir;

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

/// Writes what a peer writes, to the file that follows `--json`: 80 ms for each search, whatever it is told.
const PEER: &str = r#"
echo "$@" > "$(dirname "$0")/told.txt"
while [ "$1" != --json ]; do shift; done
echo '{"torch": "0.0", "threads": 1, "rows": [
  {"n": 63, "row": "mask", "median_ms": 5.0}, {"n": 63, "row": "raw", "median_ms": 80.0},
  {"n": 63, "row": "f-raw", "median_ms": 80.0}, {"n": 63, "row": "f-raw-eq7", "median_ms": 80.0}]}' > "$2"
"#;

/// Puts a model of the tests of masking into a folder's `models`.
fn install(folder: &Path, fixture: &str, name: &str) {
    let (from, to) = (
        Path::new(crate::PROJECT).join("services/masking/tests/models"),
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

fn runtime_is_installed() -> bool {
    let found = runtime::find(None).is_ok();
    if !found {
        println!("skipped: ONNX Runtime is not installed");
    }
    found
}

fn read_tables(folder: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(folder.join("out/tables.json")).unwrap()).unwrap()
}

fn folder() -> TempDir {
    let folder = tempfile::Builder::new()
        .prefix("gyre-tables-")
        .tempdir()
        .unwrap();
    fs::write(
        folder.path().join("small.toml"),
        "[raster]\nn = 127\ncell_m = 0.8\n",
    )
    .unwrap();
    fs::write(folder.path().join("peer.sh"), PEER).unwrap();
    folder
}

/// `gyre-lab tables` of the small recording, with little to time.
fn tables(folder: &Path) -> Command {
    let mut command = gyre();
    command.current_dir(folder).args([
        "tables",
        "--config",
        "small.toml",
        "--out",
        "out",
        "--passes",
        "1",
        "--data",
    ]);
    command.arg(recording::small());
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
    let folder = folder();
    let mut command = tables(folder.path());
    command.args([
        "--sizes",
        &SIZE.to_string(),
        "--peer",
        "sh",
        "--peer-script",
        "peer.sh",
    ]);
    let ended = Ended::of(command);
    ended.succeeded();
    let read = |name: &str| fs::read_to_string(folder.path().join(name)).unwrap();
    assert_eq!(read("out/tables.md"), ended.stdout);
    let json = read_tables(folder.path());

    let times = &json["times"]["lines"];
    for row in ROWS {
        assert!(
            line(times, row)["ours"]["ms"].as_f64().unwrap() > 0.0,
            "{row}"
        );
    }
    let f_raw = line(times, "f-raw, line 14");
    assert_eq!(f_raw["peer_ms"], 80.0);
    let ratio = f_raw["peer_over_ours"].as_f64().unwrap() * f_raw["ours"]["ms"].as_f64().unwrap();
    assert!((ratio - 80.0).abs() < 1e-9, "{ratio}");
    assert_eq!(
        (
            &line(times, "mask")["ours"],
            &line(times, "mask")["peer_ms"]
        ),
        (&Value::Null, &Value::from(5.0))
    );
    assert_eq!(
        read("told.txt").trim(),
        "--threads 1 --sizes 63 --passes 2 --rotations 31 --json out/peer-63.json"
    );

    let accuracy = &json["accuracy"][0]["lines"];
    for row in ROWS {
        let ours = &line(accuracy, row)["ours"];
        let [path, ate, search] =
            ["path_m", "ate_m", "search_ms"].map(|key| ours[key].as_f64().unwrap());
        assert!(
            path > 40.0 && ate < 0.05 * path && search > 0.0,
            "{row}: {ours:#}"
        );
    }
    assert_eq!(line(accuracy, "f-raw, Eq. 7")["paper"][0], 8.46);
    repeats(
        folder.path(),
        line(accuracy, "f-raw, line 14")["ours"]["command"]
            .as_str()
            .unwrap(),
    );

    // Without networks there is what the paper and the peer say, and what is missing.
    for row in ["mbym", "f-mbym, Eq. 7"] {
        assert_eq!(line(accuracy, row)["ours"], Value::Null);
        assert!(line(times, row)["ours"].is_null() && line(times, row)["paper_hz"].is_array());
    }
    for lines in [times, accuracy] {
        assert!(
            !lines
                .as_array()
                .unwrap()
                .iter()
                .any(|line| line["row"] == "Gyre, masked"),
            "{lines:#}"
        );
    }
    let stdout = &ended.stdout;
    assert!(
        stdout.contains("Left out. mask at 63; mbym at 63; f-mbym, Eq. 7 at 63: there is no models/f-mbym-63.toml. "),
        "{stdout}"
    );
    assert!(
        stdout.contains("Left out. mbym; f-mbym, Eq. 7: there is no models/f-mbym-255.toml. "),
        "{stdout}"
    );
    assert!(
        stdout.contains(
            "Gyre, search alone, masked; Gyre, masked: there is no models/gyre-255.toml.\n"
        ),
        "{stdout}"
    );
}

#[test]
fn masked_rows_are_timed_and_run_with_the_networks_that_there_are() {
    if !runtime_is_installed() {
        return;
    }
    let folder = folder();
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
    let json = read_tables(folder.path());
    let masked = [
        "mbym",
        "f-mbym, Eq. 7",
        "Gyre, search alone, masked",
        "Gyre, masked",
    ];

    let times = &json["times"]["lines"];
    for row in masked.iter().chain(&["mask", "mask, default"]) {
        let ours = &line(times, row)["ours"];
        assert!(
            ours["ms"].as_f64().unwrap() > 0.0
                && (ours["cell_m"].as_f64().unwrap() - 0.8).abs() < 1e-6,
            "{row}"
        );
    }
    let ms = |row: &str| line(times, row)["ours"]["ms"].as_f64().unwrap();
    assert!(ms("mask") < ms("mbym"), "{times:#}");
    assert!(line(times, "mbym")["ours"]["angles"].is_null());
    let stdout = &ended.stdout;
    assert!(
        stdout.contains("mbym at 127: models/f-mbym-127.toml (there is no models/mbym-127.toml)"),
        "{stdout}"
    );
    assert!(
        stdout.contains("models/gyre-255.toml is for 127"),
        "{stdout}"
    );

    let accuracy = &json["accuracy"][0]["lines"];
    for row in masked {
        let ours = &line(accuracy, row)["ours"];
        assert!(
            ours["masking_ms"].as_f64().unwrap() > 0.0,
            "{row}: {ours:#}"
        );
        assert_ne!(
            ours["ate_m"],
            line(accuracy, "Gyre, search alone")["ours"]["ate_m"],
            "{row}"
        );
    }
    for row in ["f-mbym, Eq. 7", "Gyre, masked"] {
        repeats(
            folder.path(),
            line(accuracy, row)["ours"]["command"].as_str().unwrap(),
        );
    }
}

#[test]
fn a_ladder_has_a_learned_mask_where_the_network_fits_the_raster() {
    if !runtime_is_installed() {
        return;
    }
    let folder = folder();
    install(folder.path(), "single-127", "gyre-255");
    fs::write(
        folder.path().join("wide.toml"),
        "[raster]\nn = 127\ncell_m = 1.0\n",
    )
    .unwrap();
    let mut command = tables(folder.path());
    command
        .args([
            "--ladder",
            "--no-table-iii",
            "--config",
            "wide.toml",
            "--data",
        ])
        .arg(recording::small());
    let ended = Ended::of(command);
    ended.succeeded();
    let json = read_tables(folder.path());
    let [small, wide] =
        [0, 1].map(|sequence| json["ladders"][sequence]["lines"].as_array().unwrap());
    assert_eq!((small.len(), wide.len()), (10, 9));
    assert_eq!(small[5]["step"], "learned mask");
    assert_ne!(small[5]["accuracy"]["ate_m"], small[4]["accuracy"]["ate_m"]);
    let mask_of = |step: &Value| {
        step["accuracy"]["command"]
            .as_str()
            .unwrap()
            .contains("masking.kind=learned")
    };
    assert_eq!(
        small.iter().map(mask_of).collect::<Vec<_>>(),
        [[false; 5], [true; 5]].concat()
    );
    let line = ended
        .stdout
        .lines()
        .find(|line| line.starts_with("| 6 learned mask |"))
        .unwrap();
    assert!(line.ends_with("| - | - | - | - |"), "{line}");
    assert!(
        ended
            .stdout
            .contains("no learned mask, for raster.cell_m is 1"),
        "{}",
        ended.stdout
    );
}

#[test]
fn a_ladder_leads_from_the_papers_form_to_each_sequences_own_configuration_side_by_side() {
    let folder = folder();
    fs::write(
        folder.path().join("wide.toml"),
        "[raster]\nn = 127\ncell_m = 1.0\n",
    )
    .unwrap();
    let mut command = tables(folder.path());
    command
        .args([
            "--ladder",
            "--no-table-iii",
            "--config",
            "wide.toml",
            "--data",
        ])
        .arg(recording::small());
    let ended = Ended::of(command);
    ended.succeeded();
    assert!(!ended.stdout.contains("## III"), "{}", ended.stdout);
    let json = read_tables(folder.path());
    let [small, wide] =
        [0, 1].map(|sequence| json["ladders"][sequence]["lines"].as_array().unwrap());
    assert_eq!((small.len(), wide.len()), (9, 9));
    for (index, step) in small.iter().chain(wide).enumerate() {
        let [path, ate] = ["path_m", "ate_m"].map(|key| step["accuracy"][key].as_f64().unwrap());
        assert!(path > 40.0 && ate < 0.05 * path, "{index}: {step:#}");
    }
    let ate = |step: &Value| step["accuracy"]["ate_m"].clone();
    // The same raster up to the step to their own.
    assert_eq!(
        small[..3].iter().map(ate).collect::<Vec<_>>(),
        wide[..3].iter().map(ate).collect::<Vec<_>>()
    );
    assert_ne!(ate(&small[3]), ate(&wide[3]));
    let own = small[8]["accuracy"]["command"].as_str().unwrap();
    assert!(!own.contains("--set"), "{own}");
    for (index, step) in small.iter().enumerate() {
        let line = format!(
            "| {} {} | - | - |",
            index + 1,
            step["step"].as_str().unwrap()
        );
        assert!(
            ended
                .stdout
                .lines()
                .any(|printed| printed.starts_with(&line)),
            "{line}: {}",
            ended.stdout
        );
    }
}

/// Asserts that a command of the table, in another folder for its results, gives what it gave in the table.
fn repeats(folder: &Path, command: &str) {
    let words: Vec<&str> = command.split(' ').collect();
    let out = words[1 + words.iter().position(|word| *word == "--out").unwrap()];
    let mut again = gyre();
    again.current_dir(folder).args(
        words[1..]
            .iter()
            .map(|word| if *word == out { "again" } else { word }),
    );
    Ended::of(again).succeeded();
    let odometry = |out: &str| fs::read_to_string(folder.join(out).join("odometry.csv")).unwrap();
    assert_eq!(odometry(out), odometry("again"));
}

#[test]
fn what_cannot_be_measured_is_refused_before_anything_is() {
    let folder = folder();
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
    let failing = ["--sizes", "63", "--peer", "sh", "--peer-script", "none.sh"];
    refused(&failing, &["the peer none.sh failed: ", "none.sh"]);
}
