//! Consistency of loops with each other: of a set of loops the largest part that agrees.
//!
//! Odometry over a long path is so uncertain that a wrong loop can pass its gate, and one that is taken bends the whole trajectory. But two
//! loops and the odometry between their ends make a cycle, and odometry between the ends of two loops of one drive is mostly short.

use std::{cmp::Reverse, collections::BTreeMap};

use gyre_estimation::{CHI_SQUARE_99_9, Constraint};
use gyre_geometry::{Pose, UncertainMotion, covariance::lever};
use nalgebra::Matrix3;

/// A loop is consistent with a set if it agrees with this share of it.
const MOST: f64 = 0.9;
/// Loops that the others are compared with, at most.
const SPEAKERS: usize = 256;

/// The odometry between any two keyframes.
#[derive(Default)]
pub struct DeadReckoning {
    poses: Vec<Pose>,
    /// Covariances of the errors of the poses: true pose = exp(error) pose. Those of the motions between add up.
    covariances: Vec<Matrix3<f64>>,
}

impl DeadReckoning {
    /// Adds a keyframe after a motion from the one before, which is not used for the first one.
    pub fn push(&mut self, motion: &UncertainMotion) {
        let (Some(last), Some(covariance)) = (self.poses.last(), self.covariances.last()) else {
            self.poses.push(Pose::identity());
            self.covariances.push(Matrix3::zeros());
            return;
        };
        let next = last * motion.motion;
        let by_motion = lever(-next.translation.x, -next.translation.y)
            * last.rotation.to_rotation_matrix().to_homogeneous();
        let covariance = covariance + by_motion * motion.covariance * by_motion.transpose();
        self.poses.push(next);
        self.covariances.push(covariance);
    }

    /// Returns the motion from keyframe `from` to keyframe `to`, which may be the earlier one.
    fn motion(&self, from: usize, to: usize) -> UncertainMotion {
        let (first, last) = (from.min(to), from.max(to));
        let to_pose = lever(self.poses[to].translation.x, self.poses[to].translation.y);
        let along = self.poses[from].rotation.inverse().to_rotation_matrix();
        let jacobian = along.to_homogeneous() * to_pose;
        let errors = self.covariances[last] - self.covariances[first];
        UncertainMotion {
            motion: self.poses[from].inv_mul(&self.poses[to]),
            covariance: jacobian * errors * jacobian.transpose(),
        }
    }

    /// Returns whether two loops and the odometry between their ends make a cycle.
    fn agree(&self, a: &Constraint, b: &Constraint) -> bool {
        let predicted = self
            .motion(b.from, a.from)
            .then(&a.motion)
            .then(&self.motion(a.to, b.to));
        let error = b.motion.error(&predicted.motion);
        let sum = predicted.covariance + b.motion.covariance;
        let chi_square = sum
            .cholesky()
            .map(|factor| error.dot(&factor.solve(&error)));
        chi_square.is_some_and(|chi_square| chi_square <= CHI_SQUARE_99_9)
    }
}

/// Returns for each loop whether it is consistent with most of the others.
///
/// Some loops, evenly chosen, speak for all. They are taken in the order of how many others each agrees with, if it agrees with most of
/// those taken. The loops must be in an order that does not depend on when they came.
pub fn consistent(odometry: &DeadReckoning, loops: &[Constraint]) -> Vec<bool> {
    let mut taken: Vec<usize> = Vec::new();
    for speaker in speakers(odometry, loops) {
        if agrees_with_most(odometry, loops, speaker, &taken) {
            taken.push(speaker);
        }
    }
    (0..loops.len())
        .map(|one| agrees_with_most(odometry, loops, one, &taken))
        .collect()
}

/// Loops that speak for all, that which agrees with most others first.
fn speakers(odometry: &DeadReckoning, loops: &[Constraint]) -> Vec<usize> {
    let step = loops.len().div_ceil(SPEAKERS).max(1);
    let mut speakers: Vec<usize> = (0..loops.len()).step_by(step).collect();
    let agreeing = |one: usize| {
        let others = speakers.iter().filter(|other| **other != one);
        others
            .filter(|other| odometry.agree(&loops[**other], &loops[one]))
            .count()
    };
    let counts: BTreeMap<usize, usize> = speakers.iter().map(|&one| (one, agreeing(one))).collect();
    speakers.sort_by_key(|one| Reverse(counts[one]));
    speakers
}

fn agrees_with_most(
    odometry: &DeadReckoning,
    loops: &[Constraint],
    one: usize,
    taken: &[usize],
) -> bool {
    let agreeing = taken
        .iter()
        .filter(|other| **other == one || odometry.agree(&loops[**other], &loops[one]));
    agreeing.count() as f64 >= MOST * taken.len() as f64
}
