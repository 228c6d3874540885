//! Composition of motions whose errors are only in part independent.
//!
//! An odometry that registers each scan with a map of the last ones has a pose error of two parts:
//! the noise of the scan's own registration, which the next motion takes back, and the drift of the
//! map, which stays. All motions share the error of the scale.

use nalgebra::{Matrix3, Vector3};

use crate::{Pose, UncertainMotion, xy_yaw};

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OdometryMotion {
    /// The pose of the later frame in the earlier one.
    pub motion: Pose,
    /// The covariance of (x, y, yaw) along the axes of the earlier frame.
    pub covariance: Matrix3<f64>,
    /// Share of the covariance that is drift, 0 to 1. The rest is noise of the two poses, one half
    /// each. With 1 the errors of motions are independent.
    pub drift_share: f64,
    /// Standard deviation of the scale, a factor that all motions of the drive share.
    pub scale_sigma: f64,
}

impl Default for OdometryMotion {
    /// No motion, without any error, as in a message of zeros where a chain of motions starts.
    fn default() -> Self {
        Self {
            drift_share: 0.0,
            ..Self::independent(UncertainMotion::identity())
        }
    }
}

impl OdometryMotion {
    pub fn independent(alone: UncertainMotion) -> Self {
        Self {
            motion: alone.motion,
            covariance: alone.covariance,
            drift_share: 1.0,
            scale_sigma: 0.0,
        }
    }

    pub fn alone(&self) -> UncertainMotion {
        UncertainMotion {
            motion: self.motion,
            covariance: self.covariance,
        }
    }

    #[must_use]
    pub fn normalized(&self) -> Self {
        let alone = self.alone().normalized();
        Self {
            motion: alone.motion,
            covariance: alone.covariance,
            ..*self
        }
    }

    pub fn drift(&self) -> UncertainMotion {
        UncertainMotion {
            motion: self.motion,
            covariance: self.covariance * self.drift_share,
        }
    }

    /// Returns the noise of the later pose, along the axes of that pose.
    pub fn noise_of_pose(&self) -> Matrix3<f64> {
        let turn = self.motion.rotation.inverse().to_rotation_matrix();
        let turn = turn.to_homogeneous();
        turn * self.noise() * turn.transpose()
    }

    fn noise(&self) -> Matrix3<f64> {
        self.covariance * (0.5 * (1.0 - self.drift_share))
    }
}

/// Motions of an odometry composed one after the other.
///
/// With the drift D_k of the motion to pose k, the noise N_0 and N_n of the first and the last
/// pose, the Jacobians J_k of Checchin et al., Eqs. 1 and 2, from pose k to the last, the
/// displacement d = (x, y, 0) and the standard deviation of the scale, the covariance is
///
/// ```text
/// J_1 N_0 J_1' + sum of J_k D_k J_k' + N_n + scale_sigma^2 d d'
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ComposedMotion {
    pub motion: UncertainMotion,
    /// The first two terms of the covariance, which further motions carry on: the drift, and the
    /// noise where the first motion begins.
    pub accumulated: Matrix3<f64>,
}

impl Default for ComposedMotion {
    fn default() -> Self {
        Self {
            motion: UncertainMotion::identity(),
            accumulated: Matrix3::zeros(),
        }
    }
}

impl ComposedMotion {
    pub fn of(first: &OdometryMotion) -> Self {
        // A vehicle that stands keeps the noise that the pose has here.
        let mut start = Self::default();
        start.motion.covariance = first.noise();
        let mut composed = start.then(first);
        composed.motion.covariance += first.noise();
        composed.accumulated += first.noise();
        composed
    }

    fn accumulated_motion(&self) -> UncertainMotion {
        UncertainMotion {
            covariance: self.accumulated,
            ..self.motion
        }
    }

    /// Continues with the next motion. A motion that is exactly zero, as of a vehicle that stands
    /// or where a chain restarts, leaves the pose unchanged, with its noise. Displacement between
    /// two chains is in no covariance.
    #[must_use]
    pub fn then(&self, next: &OdometryMotion) -> Self {
        let mut motion = self.accumulated_motion().then(&next.drift());
        let accumulated = motion.covariance;
        let at_the_end = if next.motion == Pose::identity() {
            self.motion.covariance - self.accumulated
        } else {
            let turn = self.motion.motion.rotation.to_rotation_matrix();
            let turn = turn.to_homogeneous();
            let [x_m, y_m, _] = xy_yaw(&motion.motion);
            let by_scale = Vector3::new(x_m, y_m, 0.0) * next.scale_sigma;
            turn * next.noise() * turn.transpose() + by_scale * by_scale.transpose()
        };
        motion.covariance += at_the_end;
        Self {
            motion,
            accumulated,
        }
    }

    #[must_use]
    pub fn normalized(&self) -> Self {
        Self {
            motion: self.motion.normalized(),
            accumulated: self.accumulated_motion().normalized().covariance,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;
    use crate::pose;

    fn step(drift_share: f64, scale_sigma: f64) -> OdometryMotion {
        OdometryMotion {
            motion: pose(2.0, 0.1, 0.05),
            covariance: Matrix3::from_diagonal(&Vector3::new(4e-4, 1e-4, 1e-6)),
            drift_share,
            scale_sigma,
        }
    }

    fn composed(step: &OdometryMotion, count: usize) -> UncertainMotion {
        (1..count)
            .fold(ComposedMotion::of(step), |so_far, _| so_far.then(step))
            .motion
    }

    #[test]
    fn one_motion_has_its_own_covariance() {
        let held = OdometryMotion {
            motion: Pose::identity(),
            ..step(0.3, 0.01)
        };
        for step in [step(0.0, 0.0), step(0.3, 0.0), step(1.0, 0.0), held] {
            let apart = composed(&step, 1).covariance - step.covariance;
            assert!(apart.norm() < 1e-18, "{step:?}: {apart}");
        }
    }

    #[test]
    fn motions_that_are_all_drift_are_composed_as_independent_ones() {
        let step = step(1.0, 0.0);
        let independent = (1..9).fold(step.alone(), |so_far, _| so_far.then(&step.alone()));
        assert_eq!(composed(&step, 9), independent);
    }

    #[test]
    fn the_noise_of_the_poses_between_cancels() {
        let step = step(0.0, 0.0);
        let end = composed(&step, 40);
        // Half of the noise at the end, and half of that at the start with its lever: the motion
        // itself is the same.
        let turn = (0.05f64 * 39.0).sin_cos();
        let xx = 2e-4 * turn.1.powi(2) + 5e-5 * turn.0.powi(2);
        let lever_m = end.motion.translation.y - 0.1;
        let expected = 2e-4 + 5e-7 * lever_m.powi(2) + xx;
        assert!((end.covariance[(0, 0)] / expected - 1.0).abs() < 1e-9);
        assert!((end.covariance[(2, 2)] / 1e-6 - 1.0).abs() < 1e-9);
    }

    #[test]
    fn a_scale_counts_along_the_displacement_from_the_start_whatever_way_led_there() {
        let exact = |x_m, yaw_rad| OdometryMotion {
            motion: pose(x_m, 0.0, yaw_rad),
            covariance: Matrix3::zeros(),
            ..step(0.25, 0.01)
        };
        let (ahead, turn) = (exact(30.0, 0.0), exact(40.0, FRAC_PI_2));
        let end = [ahead, turn, ahead]
            .iter()
            .fold(ComposedMotion::default(), |so_far, next| so_far.then(next));
        let expected = Matrix3::new(49.0, 21.0, 0.0, 21.0, 9.0, 0.0, 0.0, 0.0, 0.0) * 1e-2;
        assert!((end.motion.covariance - expected).norm() < 1e-12);
    }

    #[test]
    fn a_vehicle_that_stands_keeps_the_noise_of_its_pose() {
        let step = step(0.25, 0.01);
        let arrived = ComposedMotion::of(&step).then(&step);
        let held = OdometryMotion {
            motion: Pose::identity(),
            ..step
        };
        let after = arrived.then(&held).then(&held);
        let drift = held.drift().covariance * 2.0;
        let turn = arrived.motion.motion.rotation.to_rotation_matrix();
        let turn = turn.to_homogeneous();
        let expected = arrived.motion.covariance + turn * drift * turn.transpose();
        assert!((after.motion.covariance - expected).norm() < 1e-15);
        assert_eq!(after.motion.motion, arrived.motion.motion);
    }

    #[test]
    fn the_start_of_a_new_chain_changes_nothing() {
        let arrived = ComposedMotion::of(&step(0.25, 0.01)).normalized();
        let after = arrived.then(&OdometryMotion::default()).normalized();
        let apart = after.motion.covariance - arrived.motion.covariance;
        assert!(apart.norm() < 1e-18);
        assert_eq!(after.accumulated, arrived.accumulated);
        assert_eq!(after.motion.motion, arrived.motion.motion);
    }
}
