//! Covariances of (x, y, yaw), in m^2, m rad and rad^2.
//!
//! The covariance of a motion is the covariance of its x, y and yaw along the axes of the *earlier*
//! frame. The error of a motion is therefore the difference of these values, estimate minus truth,
//! with the difference in yaw wrapped to (-pi, pi].

use nalgebra::{Matrix3, Vector3};

use crate::{Pose, pose, xy_yaw};

/// The upper triangle by rows: xx, xy, x yaw, yy, y yaw, yaw yaw.
pub type Packed = [f64; 6];

pub fn pack(covariance: &Matrix3<f64>) -> Packed {
    let at = |row, column| covariance[(row, column)];
    [at(0, 0), at(0, 1), at(0, 2), at(1, 1), at(1, 2), at(2, 2)]
}

pub fn unpack(&[xx, xy, xyaw, yy, yyaw, yawyaw]: &Packed) -> Matrix3<f64> {
    Matrix3::new(xx, xy, xyaw, xy, yy, yyaw, xyaw, yyaw, yawyaw)
}

/// Tolerance of the test for positive semidefinite matrices, relative: rounding.
const ROUNDING: f64 = 1e-6;

/// Returns whether a covariance is finite and positive semidefinite, but for rounding: no variance
/// is negative, and the correlations are possible together.
pub fn is_positive_semidefinite(packed: &Packed) -> bool {
    let [xx, xy, xyaw, yy, yyaw, yawyaw] = *packed;
    // The correlation of two values; without variance there must be no covariance.
    let correlation = |between: f64, a: f64, b: f64| match a * b > 0.0 {
        true => between / (a.sqrt() * b.sqrt()),
        false if between == 0.0 => 0.0,
        false => f64::INFINITY,
    };
    let (a, b, c) = (
        correlation(xy, xx, yy),
        correlation(xyaw, xx, yawyaw),
        correlation(yyaw, yy, yawyaw),
    );
    let determinant = 1.0 + 2.0 * a * b * c - a * a - b * b - c * c;
    packed.iter().all(|value| value.is_finite())
        && [xx, yy, yawyaw].iter().all(|variance| *variance >= 0.0)
        && [a, b, c].iter().all(|share| share.abs() <= 1.0 + ROUNDING)
        && determinant >= -ROUNDING
}

/// Returns the Jacobian of a composed pose with respect to its first pose, where (x, y) is the
/// displacement from the first to the composed pose, m, along the same axes (Checchin et al., Eq.
/// 1).
pub fn lever(x_m: f64, y_m: f64) -> Matrix3<f64> {
    Matrix3::new(1.0, 0.0, -y_m, 0.0, 1.0, x_m, 0.0, 0.0, 1.0)
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UncertainMotion {
    pub motion: Pose,
    /// The covariance of (x, y, yaw) along the axes of the earlier frame.
    pub covariance: Matrix3<f64>,
}

impl UncertainMotion {
    pub fn identity() -> Self {
        Self {
            motion: Pose::identity(),
            covariance: Matrix3::zeros(),
        }
    }

    /// Composes with the motion `next`, whose error is independent, to first order (Checchin et
    /// al., Eqs. 1 and 2).
    pub fn then(&self, next: &Self) -> Self {
        let motion = self.motion * next.motion;
        let moved = motion.translation.vector - self.motion.translation.vector;
        let by_self = lever(moved.x, moved.y);
        let by_next = self.motion.rotation.to_rotation_matrix().to_homogeneous();
        let covariance = by_self * self.covariance * by_self.transpose()
            + by_next * next.covariance * by_next.transpose();
        Self { motion, covariance }
    }

    /// Rebuilds the motion from x, y, yaw and the upper triangle of the covariance, with a unit
    /// rotation and a symmetric matrix. Messages carry this form; composing it everywhere gives the
    /// same bits in one process and in several.
    pub fn normalized(&self) -> Self {
        let [x_m, y_m, yaw_rad] = xy_yaw(&self.motion);
        Self {
            motion: pose(x_m, y_m, yaw_rad),
            covariance: unpack(&pack(&self.covariance)),
        }
    }

    /// Returns the error: (x, y, yaw) of this motion minus the true motion, yaw in (-pi, pi].
    pub fn error(&self, truth: &Pose) -> Vector3<f64> {
        let apart = self.motion.translation.vector - truth.translation.vector;
        Vector3::new(
            apart.x,
            apart.y,
            truth.rotation.rotation_to(&self.motion.rotation).angle(),
        )
    }

    /// Returns whether the covariance is finite and positive definite, so that it can normalise
    /// errors.
    pub fn has_covariance(&self) -> bool {
        let c = &self.covariance;
        c.iter().all(|value| value.is_finite()) && c.cholesky().is_some()
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use super::*;

    fn diagonal(x: f64, y: f64, yaw: f64) -> Matrix3<f64> {
        Matrix3::from_diagonal(&Vector3::new(x, y, yaw))
    }

    fn uncertain(motion: Pose, covariance: Matrix3<f64>) -> UncertainMotion {
        UncertainMotion { motion, covariance }
    }

    #[test]
    fn a_covariance_is_finite_and_has_no_negative_direction() {
        for packed in [
            [0.0; 6],
            [1.0, 0.0, 0.0, 0.0, 0.0, 2.0],
            [1.0, 0.5, 0.2, 1.0, -0.3, 1.0],
            [4.0, 2.0, 2.0, 1.0, 1.0, 1.0],
            [1e-12, 0.0, 0.0, 1e12, 0.0, 1e-6],
        ] {
            assert!(is_positive_semidefinite(&packed), "{packed:?}");
        }
        for packed in [
            [-1.0, 0.0, 0.0, 1.0, 0.0, 1.0],
            [1.0, 1.1, 0.0, 1.0, 0.0, 1.0],
            [1.0, 0.9, 0.9, 1.0, -0.9, 1.0],
            [0.0, 0.1, 0.0, 1.0, 0.0, 1.0],
            [f64::NAN, 0.0, 0.0, 1.0, 0.0, 1.0],
            [1.0, 0.0, 0.0, f64::INFINITY, 0.0, 1.0],
        ] {
            assert!(!is_positive_semidefinite(&packed), "{packed:?}");
        }
    }

    #[test]
    fn composed_covariances_rotate_with_the_first_motion() {
        let turn = uncertain(pose(2.0, 0.0, FRAC_PI_2), diagonal(0.0, 0.0, 1e-4));
        let both = turn.then(&uncertain(pose(10.0, 0.0, 0.0), diagonal(4.0, 1.0, 0.0)));
        let place = nalgebra::Vector2::new(2.0, 10.0);
        assert!((both.motion.translation.vector - place).norm() < 1e-12);
        // 10 m to the left at 0.01 rad: 0.1 m along x. The second motion's x is now y.
        let expected = Matrix3::new(1.01, 0.0, -1e-3, 0.0, 4.0, 0.0, -1e-3, 0.0, 1e-4);
        assert!(
            (both.covariance - expected).norm() < 1e-12,
            "{}",
            both.covariance
        );
    }

    #[test]
    fn errors_of_yaw_are_wrapped() {
        let estimate = uncertain(pose(1.0, 2.0, PI - 0.1), Matrix3::identity());
        let error = estimate.error(&pose(0.5, 3.0, -PI + 0.1));
        assert!(
            (error - Vector3::new(0.5, -1.0, -0.2)).norm() < 1e-12,
            "{error}"
        );
    }

    #[test]
    fn zero_nan_and_indefinite_matrices_are_not_covariances() {
        let has = |covariance| uncertain(Pose::identity(), covariance).has_covariance();
        assert!(has(diagonal(1e-4, 1e-4, 1e-8)));
        assert!(!has(Matrix3::zeros()));
        assert!(!has(diagonal(1.0, f64::NAN, 1.0)) && !has(diagonal(1.0, -1.0, 1.0)));
    }
}
