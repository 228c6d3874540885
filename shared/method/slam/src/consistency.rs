//! Consistency of loops with each other. Odometry over a long path is so uncertain that a wrong
//! loop can pass its gate; but two loops and the mostly short odometry between their ends make a
//! cycle.

use std::cmp::Reverse;

use crate::estimation::{CHI_SQUARE_99_9, Constraint, chi_square};
use gyre_geometry::{Pose, UncertainMotion, covariance::lever};
use nalgebra::Matrix3;

const MOST: f64 = 0.9;
/// Loops that speak for all, at most.
const SPEAKERS: usize = 256;

#[derive(Default)]
pub struct DeadReckoning {
    poses: Vec<Pose>,
    /// Covariances of the errors of the poses: true pose = exp(error) pose. The covariances of the
    /// motions between poses add up.
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

    pub fn motion(&self, from: usize, to: usize) -> UncertainMotion {
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

    fn agree(&self, a: &Constraint, b: &Constraint) -> bool {
        let predicted = self
            .motion(b.from, a.from)
            .then(&a.motion)
            .then(&self.motion(a.to, b.to));
        let error = b.motion.error(&predicted.motion);
        let sum = predicted.covariance + b.motion.covariance;
        chi_square(&error, &sum) <= CHI_SQUARE_99_9
    }
}

/// Some of the loops, which agree with each other and speak for all.
#[derive(Default)]
pub struct Speakers(Vec<Constraint>);

impl Speakers {
    /// Chooses among loops, evenly: in the order of how many others each agrees with, those that
    /// agree with most of those chosen before. The loops must be in an order that does not depend
    /// on when they came.
    pub fn choose(odometry: &DeadReckoning, loops: &[Constraint]) -> Self {
        let mut chosen = Self::default();
        for speaker in by_agreement(odometry, loops) {
            if chosen.accept(odometry, speaker) {
                chosen.0.push(*speaker);
            }
        }
        chosen
    }

    /// Returns whether a loop is consistent with most of them.
    pub fn accept(&self, odometry: &DeadReckoning, one: &Constraint) -> bool {
        let agrees = |other: &&Constraint| *other == one || odometry.agree(other, one);
        self.0.iter().filter(agrees).count() as f64 >= MOST * self.0.len() as f64
    }
}

/// Some loops, evenly chosen, that which agrees with most others first.
fn by_agreement<'a>(odometry: &DeadReckoning, loops: &'a [Constraint]) -> Vec<&'a Constraint> {
    let step = loops.len().div_ceil(SPEAKERS).max(1);
    let some: Vec<&Constraint> = loops.iter().step_by(step).collect();
    let agreeing = |one: usize| {
        let others = some.iter().enumerate().filter(|(other, _)| *other != one);
        others
            .filter(|(_, other)| odometry.agree(other, some[one]))
            .count()
    };
    let mut order: Vec<(usize, &Constraint)> = (0..some.len())
        .map(|one| (agreeing(one), some[one]))
        .collect();
    order.sort_by_key(|(agreeing, _)| Reverse(*agreeing));
    order.into_iter().map(|(_, one)| one).collect()
}
