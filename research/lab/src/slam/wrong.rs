//! Wrong loops.

use std::f64::consts::PI;

use gyre_slam::estimation::Constraint;
use gyre_geometry::{UncertainMotion, pose};
use nalgebra::{Matrix3, Vector3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::drive::Drive;

/// Standard deviations of a loop: m, m, rad.
const SIGMA: [f64; 3] = [0.05, 0.05, 0.001];

/// Returns `count` loops between keyframes that are not of the same place, in runs of `length` that
/// agree with each other: as if a stretch of the path lay, within 5 m and at any heading, where
/// another one is. They are in the order of the later keyframes.
pub fn loops(drive: &Drive, count: usize, length: usize) -> Vec<Constraint> {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let keyframes = drive.keyframes.len();
    let covariance = Matrix3::from_diagonal(&Vector3::from(SIGMA.map(|sigma| sigma * sigma)));
    let mut loops = Vec::new();
    while loops.len() < count && keyframes > 50 + 2 * length {
        let to = random.random_range(50 + length..keyframes - length);
        let from = random.random_range(0..to - 50);
        let shift = pose(
            random.random_range(-5.0..5.0),
            random.random_range(-5.0..5.0),
            random.random_range(-PI..PI),
        );
        if drive.true_distance_m(from, to) < 20.0 {
            continue;
        }
        let at = |k: usize| drive.keyframes[k].pose.motion;
        let moved = at(from) * shift * at(to).inverse();
        loops.extend((0..length).map(|k| {
            let motion = at(from + k).inv_mul(&(moved * at(to + k)));
            Constraint::closing(from + k, to + k, UncertainMotion { motion, covariance })
        }));
    }
    loops.sort_by_key(|closing| closing.to);
    loops
}
