//! `gyre-lab realism` as a whole, on small simulated recordings.

use std::{fs, path::Path};

use gyre_simulator::{SimulationConfig, write_dataset};
use serde_json::Value;
use tempfile::TempDir;

use crate::{
    common::{Ended, real_data, recording},
    gyre_lab,
};

/// A folder with `other`, a drive through another town, and the configuration that simulated
/// recordings are read with.
fn folder() -> TempDir {
    let folder = crate::common::folder();
    let config = SimulationConfig {
        scans: Some(8),
        seed: 7,
        traffic: gyre_simulator::traffic::TrafficConfig::none(),
        ..SimulationConfig::default()
    };
    write_dataset(&config, &folder.path().join("other"), &mut |_, _| ()).unwrap();
    folder
}

/// `gyre-lab realism` in a folder.
fn realism(folder: &Path, arguments: &[&str]) -> Ended {
    let mut command = gyre_lab();
    command
        .current_dir(folder)
        .args(["realism", "--out", "out", "--configs"])
        .arg(Path::new(crate::PROJECT).join("configs"))
        .args(arguments);
    Ended::of(command)
}

fn report(folder: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(folder.join("out/realism.json")).unwrap()).unwrap()
}

fn rows(report: &Value) -> &Vec<Value> {
    report["tables"][0]["rows"].as_array().unwrap()
}

#[test]
fn a_recording_is_closer_to_itself_than_another_is_in_all_that_is_measured() {
    let folder = folder();
    let small = recording::small().to_str().unwrap();
    let configs = [
        "--sim-config",
        "small.toml",
        "--real-config",
        "small.toml",
        "--between-config",
        "small.toml",
    ];
    let arguments = [small, small, "--between", "other", "--scans", "8"];
    let ended = realism(folder.path(), &[&arguments, &configs[..]].concat());
    ended.succeeded();
    let report = report(folder.path());
    for row in rows(&report).iter().filter(|row| !row["sim"].is_null()) {
        assert_eq!(row["sim_real"], 0.0, "{row:#}");
    }
    let judged = rows(&report).iter().filter(|row| !row["closer"].is_null());
    let judged: Vec<&Value> = judged.collect();
    assert!(judged.len() >= 12, "{report:#}");
    assert!(judged.iter().all(|row| row["closer"] == true), "{report:#}");
    let last = ended.stdout.lines().last().unwrap();
    assert_eq!(last, format!("closer in {0} of {0}", judged.len()));
    assert_eq!(
        fs::read_to_string(folder.path().join("out/realism.md")).unwrap(),
        ended.stdout
    );
    for measured in [
        format!("sim: {small}, 8 scans, 7 pairs"),
        "other: other, 8 scans".to_owned(),
    ] {
        assert!(ended.stdout.contains(&measured), "{}", ended.stdout);
    }
}

#[test]
fn one_scan_and_a_recording_without_truth_have_what_can_be_had() {
    let folder = folder();
    let single = recording::copy(1);
    fs::remove_dir_all(folder.path().join("other/gt")).unwrap();
    fs::remove_file(folder.path().join("other/ground_truth.tum")).unwrap();
    let configs = ["--sim-config", "small.toml", "--real-config", "small.toml"];
    let ended = realism(
        folder.path(),
        &[&[single.path().to_str().unwrap(), "other"], &configs[..]].concat(),
    );
    ended.succeeded();
    let report = report(folder.path());
    // Aligned by odometry.
    let aligned = "real: other, 8 scans, 7 pairs";
    assert!(ended.stdout.contains(aligned), "{}", ended.stdout);
    for row in rows(&report) {
        let statistic = row["statistic"].as_str().unwrap();
        let of_scans = [
            "next scan",
            "plain search",
            "refined search",
            "searched and refined",
        ];
        let needs_two = of_scans.iter().any(|of| statistic.starts_with(of));
        assert_eq!(row["sim"].is_null(), needs_two, "{row:#}");
        assert_eq!(row["sim_real"].is_null(), needs_two, "{row:#}");
        // So short a drive has no turn.
        if !statistic.ends_with("in turns") {
            let needs_truth = statistic.contains(" search: ");
            assert_eq!(row["real"].is_null(), needs_truth, "{row:#}");
        }
        assert!(row["closer"].is_null(), "{row:#}");
    }
}

#[test]
fn without_runs_the_scans_alone_are_measured() {
    let folder = folder();
    let small = recording::small().to_str().unwrap();
    let ended = realism(
        folder.path(),
        &[small, "other", "--search-scans", "0", "--scans", "5"],
    );
    ended.succeeded();
    let report = report(folder.path());
    let measured = format!("sim: {small}, 5 scans, 4 pairs");
    assert!(ended.stdout.contains(&measured), "{}", ended.stdout);
    assert!(!folder.path().join("out/sim/gyre").exists());
    let distance = rows(&report)[0]["sim_real"].as_f64().unwrap();
    assert!(distance > 0.01, "{distance}");
}

#[test]
fn what_cannot_be_compared_is_refused() {
    let folder = folder();
    realism(folder.path(), &["other", "nowhere"]).refused_with(&["nowhere"]);
    realism(
        folder.path(),
        &["other", "other", "--real-config", "none.toml"],
    )
    .refused_with(&["none.toml"]);
}

/// Another part of the same drive is nearer than a drive with another radar of the same kind.
#[test]
fn one_drive_is_closer_to_itself_than_to_another() {
    let (Some(radiate), Some(oxford)) = (
        real_data("radiate-2019-02-12"),
        real_data("oxford-2019-01-10-14-36-48"),
    ) else {
        return;
    };
    let folder = folder();
    let part = |name: &str, source: &str| {
        let text = format!(
            "[dataset]\nformat = \"radiate\"\nrange_offset_m = -0.15\n[source]\n{source}\n"
        );
        fs::write(folder.path().join(name), text).unwrap();
    };
    part("first.toml", "scans = 233");
    part("second.toml", "first = 233");
    let [radiate, oxford] = [&radiate, &oxford].map(|path| path.to_str().unwrap());
    let configs = [
        "--sim-config",
        "first.toml",
        "--real-config",
        "second.toml",
        "--search-scans",
        "0",
    ];
    let ended = realism(
        folder.path(),
        &[&[radiate, radiate, "--between", oxford], &configs[..]].concat(),
    );
    ended.succeeded();
    let report = report(folder.path());
    for (index, factor) in [(0, 10.0), (1, 5.0), (5, 5.0)] {
        let row = &rows(&report)[index];
        let [near, far] = ["sim_real", "real_other"].map(|key| row[key].as_f64().unwrap());
        assert!(factor * near < far, "{row:#}");
    }
}
