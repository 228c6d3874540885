//! The relative pose of two keyframes, predicted from their poses (Checchin et al., Eq. 3).

use gyre_geometry::{Pose, covariance::lever, wrap_angle};
use nalgebra::{Matrix3, Vector3};

#[derive(Debug, Clone, Copy)]
pub(crate) struct Relative {
    /// The pose of `to` in the frame of `from`.
    pub motion: Pose,
    /// Jacobian of (x, y, yaw) of the motion with respect to (x, y, yaw) of `from`.
    pub by_from: Matrix3<f64>,
    pub by_to: Matrix3<f64>,
}

impl Relative {
    /// Predicts the pose of `to` in the frame of `from`: Checchin et al., Eq. 3,
    /// T = (-)((-) x_to (+) x_from), whose outer inverse makes this (-) x_from (+) x_to.
    pub fn predict(from: &Pose, to: &Pose) -> Self {
        let motion = from.inv_mul(to);
        let apart = to.translation.vector - from.translation.vector;
        let by_to = from
            .rotation
            .inverse()
            .to_rotation_matrix()
            .to_homogeneous();
        Self {
            motion,
            by_from: -by_to * lever(apart.x, apart.y),
            by_to,
        }
    }
}

/// Moves a pose by a correction of its x, y and yaw.
pub(crate) fn corrected(pose: &Pose, correction: &Vector3<f64>) -> Pose {
    let yaw_rad = wrap_angle(pose.rotation.angle() + correction.z);
    Pose::new(pose.translation.vector + correction.xy(), yaw_rad)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gyre_geometry::{UncertainMotion, pose, xy_yaw};
    use proptest::prelude::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    #[test]
    fn the_relative_pose_of_two_poses_worked_by_hand() {
        // From 1 m ahead, facing left, a pose 3 m to its left that faces backward is 2 m ahead and
        // 1 m to the right, turned left.
        let relative = Relative::predict(&pose(1.0, 1.0, FRAC_PI_2), &pose(2.0, 3.0, PI));
        let [x, y, yaw] = xy_yaw(&relative.motion);
        assert!((x - 2.0).abs() < 1e-15 && (y + 1.0).abs() < 1e-15);
        assert!((yaw - FRAC_PI_2).abs() < 1e-15);
        // The same by the operators of Eq. 3 as printed.
        let printed = (pose(2.0, 3.0, PI).inverse() * pose(1.0, 1.0, FRAC_PI_2)).inverse();
        assert!((printed.translation.vector - relative.motion.translation.vector).norm() < 1e-15);
        assert!(printed.rotation.angle_to(&relative.motion.rotation).abs() < 1e-15);
    }

    proptest! {
        #[test]
        fn jacobians_are_the_differences_of_corrected_poses(
            a in prop::array::uniform3(-3.0..3.0f64), b in prop::array::uniform3(-3.0..3.0f64),
        ) {
            let (from, to) = (pose(a[0], a[1], a[2]), pose(b[0], b[1], b[2]));
            let relative = Relative::predict(&from, &to);
            for axis in 0..3 {
                let mut step = Vector3::zeros();
                step[axis] = 1e-6;
                let difference = |from: &Pose, to: &Pose| {
                    let moved = UncertainMotion { motion: from.inv_mul(to), ..UncertainMotion::identity() };
                    moved.error(&relative.motion) / 1e-6
                };
                let by_from = difference(&corrected(&from, &step), &to);
                let by_to = difference(&from, &corrected(&to, &step));
                prop_assert!((by_from - relative.by_from.column(axis)).norm() < 1e-5);
                prop_assert!((by_to - relative.by_to.column(axis)).norm() < 1e-5);
            }
        }
    }
}
