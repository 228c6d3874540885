//! Drives for tests.
#![allow(dead_code)] // No test uses all of it.

use std::num::NonZeroUsize;

use gyre_geometry::{Pose, pose};
use gyre_radar::Trajectory;
use gyre_results::evaluation::{Evaluation, evaluate};
use proptest::prelude::*;

pub fn by_index(estimate: &[Pose], truth: &[Pose], step: usize) -> Evaluation {
    let [estimate, truth] = [estimate, truth].map(|poses| Trajectory::untimed(poses.to_vec()));
    evaluate(&estimate, &truth, NonZeroUsize::new(step).unwrap()).unwrap()
}

/// Returns the poses of motions from `start`.
pub fn chain(start: Pose, motions: impl IntoIterator<Item = Pose>) -> Vec<Pose> {
    let mut here = start;
    let mut poses = vec![here];
    for motion in motions {
        here *= motion;
        poses.push(here);
    }
    poses
}

/// Returns a drive of `n` motions of 2.37 m (no segment length is a multiple) with bends that
/// repeat every `bend` motions, more to the left.
pub fn drive(n: usize, bend: f64) -> Vec<Pose> {
    let turn = |k: usize| 0.03 * (k as f64 * std::f64::consts::TAU / bend).sin() + 0.003;
    let motions = (0..n).map(|k| pose(2.37, 0.0, turn(k)));
    chain(pose(7.0, -3.0, 0.4), motions)
}

/// The parameters of a random [`drive`] of 150 m to 1.2 km.
pub fn any_drive() -> impl Strategy<Value = (usize, f64)> {
    (60usize..480, 40.0..200.0)
}

/// A random planar motion of up to a few kilometres.
pub fn any_pose() -> impl Strategy<Value = Pose> {
    (-3000.0..3000.0, -3000.0..3000.0, -3.2..3.2).prop_map(|(x, y, yaw)| pose(x, y, yaw))
}
