//! Motions with covariances: composed, and held against the truth.
//!
//! The covariance of a motion is that of its three numbers (x, y, yaw), along the axes of the *earlier* frame. Its error is
//! therefore the plain difference of these numbers, estimate less truth, the yaw's the shorter way round.

use nalgebra::{Matrix3, Vector3};
use serde::Serialize;

use crate::Pose;

/// The pose of a later frame in an earlier one, with the covariance of (x, y, yaw): m, rad, along the earlier frame's axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UncertainMotion {
    /// The motion.
    pub motion: Pose,
    /// Covariance of (x, y, yaw).
    pub covariance: Matrix3<f64>,
}

impl UncertainMotion {
    /// No motion, known exactly.
    pub fn standing() -> Self {
        Self {
            motion: Pose::identity(),
            covariance: Matrix3::zeros(),
        }
    }

    /// This motion, then `next`, whose error is independent; to first order, as pose integration does it.
    pub fn then(&self, next: &Self) -> Self {
        let motion = self.motion * next.motion;
        let moved = motion.translation.vector - self.motion.translation.vector;
        let by_self = seen_from(moved.x, moved.y);
        let by_next = self.motion.rotation.to_rotation_matrix().to_homogeneous();
        // Checchin et al., Eqs. 1 and 2
        let covariance = by_self * self.covariance * by_self.transpose()
            + by_next * next.covariance * by_next.transpose();
        Self { motion, covariance }
    }

    /// (x, y, yaw) of the estimate less those of the truth, yaw in (-pi, pi].
    pub fn error(&self, truth: &Pose) -> Vector3<f64> {
        let apart = self.motion.translation.vector - truth.translation.vector;
        let turned = truth.rotation.rotation_to(&self.motion.rotation).angle();
        Vector3::new(apart.x, apart.y, turned)
    }

    /// Whether the covariance is one that errors can be measured by.
    pub fn has_covariance(&self) -> bool {
        let c = &self.covariance;
        c.iter().all(|value| value.is_finite()) && c.cholesky().is_some()
    }
}

/// Standard deviations of each pose of the truth, independent from pose to pose.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct TruthSigma {
    /// Of x, and of y, m.
    pub position_m: f64,
    /// Of the heading, rad.
    pub yaw_rad: f64,
}

impl TruthSigma {
    /// What it adds to the covariance of a true motion: both ends are uncertain, and the first end's heading swings the
    /// second end sideways.
    pub fn of_motion(&self, truth: &Pose) -> Matrix3<f64> {
        let variance_m2 = self.position_m * self.position_m;
        let pose = Matrix3::from_diagonal(&Vector3::new(
            variance_m2,
            variance_m2,
            self.yaw_rad * self.yaw_rad,
        ));
        let by_first = seen_from(truth.translation.x, truth.translation.y);
        by_first * pose * by_first.transpose() + pose
    }
}

/// How an error of a pose shows in one that lies (x, y) further on, in the same axes.
fn seen_from(x_m: f64, y_m: f64) -> Matrix3<f64> {
    Matrix3::new(1.0, 0.0, -y_m, 0.0, 1.0, x_m, 0.0, 0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use super::*;
    use crate::pose;

    fn diagonal(x: f64, y: f64, yaw: f64) -> Matrix3<f64> {
        Matrix3::from_diagonal(&Vector3::new(x, y, yaw))
    }

    #[test]
    fn composed_covariances_swing_and_turn_with_the_first_motion() {
        let turn = UncertainMotion {
            motion: pose(2.0, 0.0, FRAC_PI_2),
            covariance: diagonal(0.0, 0.0, 1e-4),
        };
        let ahead = UncertainMotion {
            motion: pose(10.0, 0.0, 0.0),
            covariance: diagonal(4.0, 1.0, 0.0),
        };
        let both = turn.then(&ahead);
        assert!(
            (both.motion.translation.vector - nalgebra::Vector2::new(2.0, 10.0)).norm() < 1e-12
        );
        // 10 m to the left at 0.01 rad: 0.1 m along x; the second motion's x is now y
        let expected = Matrix3::new(1.01, 0.0, -1e-3, 0.0, 4.0, 0.0, -1e-3, 0.0, 1e-4);
        assert!(
            (both.covariance - expected).norm() < 1e-12,
            "{}",
            both.covariance
        );
    }

    #[test]
    fn errors_of_yaw_take_the_shorter_way() {
        let estimate = UncertainMotion {
            motion: pose(1.0, 2.0, PI - 0.1),
            covariance: Matrix3::identity(),
        };
        let error = estimate.error(&pose(0.5, 3.0, -PI + 0.1));
        assert!(
            (error - Vector3::new(0.5, -1.0, -0.2)).norm() < 1e-12,
            "{error}"
        );
    }

    #[test]
    fn zero_not_a_number_and_indefinite_are_no_covariances() {
        let has = |covariance| {
            UncertainMotion {
                motion: Pose::identity(),
                covariance,
            }
            .has_covariance()
        };
        assert!(has(diagonal(1e-4, 1e-4, 1e-8)));
        assert!(
            !has(Matrix3::zeros())
                && !has(diagonal(1.0, f64::NAN, 1.0))
                && !has(diagonal(1.0, -1.0, 1.0))
        );
    }

    #[test]
    fn the_truths_heading_swings_a_long_motion() {
        let sigma = TruthSigma {
            position_m: 0.1,
            yaw_rad: 0.01,
        };
        let noise = sigma.of_motion(&pose(100.0, 0.0, 0.0));
        assert!((noise[(0, 0)] - 0.02).abs() < 1e-12 && (noise[(1, 1)] - 1.02).abs() < 1e-12);
        assert!((noise[(2, 2)] - 2e-4).abs() < 1e-15 && (noise[(1, 2)] - 0.01).abs() < 1e-12);
    }
}
