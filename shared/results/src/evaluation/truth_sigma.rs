//! The uncertainty of the ground truth itself.

use gyre_geometry::{Pose, covariance::lever};
use nalgebra::{Matrix3, Vector3};
use serde::Serialize;

/// Standard deviations of each ground-truth pose, independent from pose to pose.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct TruthSigma {
    pub position_m: f64,
    pub yaw_rad: f64,
}

impl TruthSigma {
    /// The covariance of a true motion: both ends are uncertain, and the error of the first heading
    /// grows into a lateral error of the second end.
    pub fn of_motion(&self, truth: &Pose) -> Matrix3<f64> {
        let variance_m2 = self.position_m * self.position_m;
        let variances = Vector3::new(variance_m2, variance_m2, self.yaw_rad * self.yaw_rad);
        let pose = Matrix3::from_diagonal(&variances);
        let by_first = lever(truth.translation.x, truth.translation.y);
        by_first * pose * by_first.transpose() + pose
    }
}
