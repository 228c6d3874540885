//! The KITTI errors of published trajectories, compared with the published figures.

use std::{fs, path::PathBuf};

use crate::common::by_index;
use gyre_geometry::Pose;
use gyre_results::evaluation::Evaluation;
use nalgebra::{Complex, Unit};

/// The folder of real data; without it the tests are skipped.
fn data() -> Option<PathBuf> {
    let root = std::env::var_os("GYRE_DATA").map(PathBuf::from);
    if root.is_none() {
        println!("skipped: GYRE_DATA is not set");
    }
    root
}

/// Reads KITTI poses: a 3 x 4 matrix by rows, twelve numbers a line. Cosine and sine are not
/// normalised, because the fifth decimal of the published figures depends on their rounding.
fn kitti_poses(path: PathBuf) -> Vec<Pose> {
    let parse = |line: &str| {
        let numbers = line.split_whitespace().map(|v| v.parse().unwrap());
        let m: Vec<f64> = numbers.collect();
        let rotation = Unit::new_unchecked(Complex::new(m[0], m[4]));
        Pose::from_parts([m[3], m[7]].into(), rotation)
    };
    let text = fs::read_to_string(path).unwrap();
    text.lines().map(parse).collect()
}

/// Returns translation (%) and rotation (deg/100 m) to five decimals, as published.
fn five_decimals(evaluation: &Evaluation) -> [String; 2] {
    let kitti = evaluation.kitti.as_ref().unwrap();
    [kitti.translation_percent, kitti.rotation_deg_per_100m].map(|it| format!("{it:.5}"))
}

#[test]
fn kitti_errors_equal_the_published_figures_at_all_steps() {
    let Some(data) = data() else { return };
    let case = data.join("golden/kitti-metric");
    let [estimate, truth] =
        ["estimate.txt", "ground_truth.txt"].map(|name| kitti_poses(case.join(name)));
    for (step, expected) in [
        (10, ["1.16688", "0.34558"]),
        (4, ["1.16084", "0.34663"]),
        (1, ["1.16168", "0.34696"]),
    ] {
        let evaluation = by_index(&estimate, &truth, step);
        assert_eq!(five_decimals(&evaluation), expected, "step {step}");
        assert!(!evaluation.axes.y_negated && !evaluation.axes.heading_negated);
    }
}
