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
