//! Real scans (`GYRE_DATA`) through the whole pipeline, with the accuracy that is to be kept.

use std::path::{Path, PathBuf};

use crate::common::{Run, odometry, real_data};
use serde_json::Value;

fn configuration(name: &str) -> PathBuf {
    Path::new(crate::PROJECT).join("configs").join(name)
}

fn figure(json: &Value, path: &str) -> f64 {
    let value = json
        .pointer(path)
        .unwrap_or_else(|| panic!("no {path} in {json:#}"));
    value
        .as_f64()
        .unwrap_or_else(|| panic!("{path} is {value}"))
}

#[test]
fn oxford_turns_and_drives_as_its_ground_truth_says() {
    let Some(data) = real_data("oxford-2019-01-10-14-36-48") else {
        return;
    };
    let run = Run::of_file(&configuration("oxford.toml")).data(&data);
    assert_eq!(odometry::rows(&run.complete()).len(), 10);
    let summary = run.summary();
    let rotation_deg = figure(&summary, "/evaluation/rpe/rotation_rmse_deg");
    let forward = figure(&summary, "/evaluation/rpe/forward_ratio");
    println!("rotation {rotation_deg:.3} deg a pair, forward {forward:.4} of the truth");
    assert!(
        rotation_deg <= 0.11 && (forward - 1.0).abs() <= 0.005,
        "{rotation_deg} deg, {forward}"
    );
}

#[test]
#[ignore = ".ci/nightly: a whole drive"]
fn radiate_drifts_less_than_cfear_2() {
    let Some(data) = real_data("radiate-2019-02-12") else {
        return;
    };
    let run = Run::of_file(&configuration("radiate.toml")).data(&data);
    assert_eq!(odometry::rows(&run.complete()).len(), 465);
    let summary = run.summary();
    for (path, most) in [
        ("/evaluation/kitti/translation_percent", 1.7),
        ("/evaluation/kitti/rotation_deg_per_100m", 0.65),
        ("/evaluation/ate/rmse_m", 1.7),
        ("/evaluation/seg/percent", 0.33),
    ] {
        let value = figure(&summary, path);
        println!("{path} {value:.3}");
        assert!(value <= most, "{path} is {value}, more than {most}");
    }
}

#[test]
fn fog_without_ground_truth_is_run_all_the_same() {
    let Some(data) = real_data("radiate-tiny_foggy") else {
        return;
    };
    let run = Run::of_file(&configuration("radiate.toml")).data(&data);
    assert_eq!(odometry::rows(&run.complete()).len(), 17);
    assert!(run.summary()["evaluation"].is_null());
}
