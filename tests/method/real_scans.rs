//! Real scans (`GYRE_DATA`) through the whole pipeline, with the accuracy that is to be kept.

use crate::{
    common::{odometry, real_data},
    method::in_process::configuration,
};

/// Runs a drive, and asserts that so many motions come of it, with figures in these ranges.
fn assert_accurate(drive: &str, name: &str, motions: usize, figures: &[(&str, f64, f64)]) {
    let Some(data) = real_data(drive) else {
        return;
    };
    let run = configuration(name).data(&data);
    assert_eq!(odometry::rows(&run.complete()).len(), motions);
    let evaluation = &run.summary()["evaluation"];
    assert_eq!(evaluation.is_null(), figures.is_empty());
    for (path, least, most) in figures {
        let value = evaluation.pointer(path).and_then(|it| it.as_f64());
        println!("{path} {value:?}");
        assert!(
            value.is_some_and(|it| (*least..=*most).contains(&it)),
            "{path}: {evaluation:#}"
        );
    }
}

#[test]
fn oxford_turns_and_drives_as_its_ground_truth_says() {
    let figures = [
        ("/rpe/rotation_rmse_deg", 0.0, 0.11),
        ("/rpe/forward_ratio", 0.995, 1.005),
    ];
    assert_accurate("oxford-2019-01-10-14-36-48", "oxford.toml", 10, &figures);
}

#[test]
#[ignore = ".ci/nightly: a whole drive"]
fn radiate_drifts_less_than_cfear_2() {
    let figures = [
        ("/kitti/translation_percent", 0.0, 1.7),
        ("/kitti/rotation_deg_per_100m", 0.0, 0.65),
        ("/ate/rmse_m", 0.0, 1.7),
        ("/seg/percent", 0.0, 0.33),
    ];
    assert_accurate("radiate-2019-02-12", "radiate.toml", 465, &figures);
}

#[test]
fn fog_without_ground_truth_is_run_all_the_same() {
    assert_accurate("radiate-tiny_foggy", "radiate.toml", 17, &[]);
}
