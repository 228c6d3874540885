//! The KITTI errors of published trajectories, compared with the published figures.

use std::{fs, path::PathBuf};

use crate::common::{by_index, chain};
use gyre_evaluation::{Coverage, Evaluation};
use gyre_geometry::{Pose, pose};
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

/// Reads Oxford's motions and chains them from the identity, in their own frame: y right, yaw
/// clockwise.
fn chained_csv(path: PathBuf) -> Vec<Pose> {
    let mut motions = Vec::new();
    for line in fs::read_to_string(path).unwrap().lines().skip(1) {
        let field: Vec<f64> = line.split(',').map(|v| v.parse().unwrap()).collect();
        motions.push(pose(field[2], field[3], field[7]));
    }
    chain(Pose::identity(), motions)
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

#[test]
fn kitti_errors_of_chained_motions_equal_the_published_figures_in_both_handednesses() {
    let Some(data) = data() else { return };
    let estimate = kitti_poses(data.join("golden/csv-chain/estimate.txt"));
    let y_right =
        chained_csv(data.join("trajectories/oxford-2019-01-10-11-46-21.radar_odometry.csv"));
    let mirrored = |p: &Pose| pose(p.translation.x, -p.translation.y, -p.rotation.angle());
    let y_left: Vec<_> = y_right.iter().map(mirrored).collect();
    let evaluations = [&y_right, &y_left].map(|truth| by_index(&estimate, truth, 10));
    for evaluation in &evaluations {
        assert_eq!(five_decimals(evaluation), ["1.22286", "0.39305"]);
        assert_eq!(evaluation.axes.y_negated, evaluation.axes.heading_negated);
        assert!(matches!(
            evaluation.coverage,
            Coverage::Index {
                matched: 8865,
                estimate_surplus: 0,
                ..
            }
        ));
        println!("{evaluation:#}\n");
    }
    let mirrored = evaluations.map(|e| e.axes.y_negated);
    assert_eq!(mirrored.iter().filter(|&&m| m).count(), 1, "{mirrored:?}");
}
