//! Covariances of refined and predicted motions.

use gyre_geometry::Pose;
use nalgebra::{Matrix3, Vector3};

use super::{RefinementConfig, alignment::Alignment, points::DeskewedPoints};

/// The covariance of the motion from `previous` to an alignment, from the information matrix; `None` if the points do not
/// determine the pose.
pub(super) fn of_alignment(
    alignment: &Alignment,
    points: &DeskewedPoints,
    previous: &Pose,
    config: &RefinementConfig,
) -> Option<Matrix3<f64>> {
    let inverse = alignment.normal.information.try_inverse()?;
    let mean_squared_residual = alignment.normal.cost / points.total_weight();
    // From the map's axes to those of the previous scan.
    let turn = previous
        .rotation
        .inverse()
        .to_rotation_matrix()
        .to_homogeneous();
    // The mean weight cancels a factor that all weights share, as under a mask.
    let scale = config.variance_scale * points.mean_weight() * mean_squared_residual;
    let shape = turn * inverse * turn.transpose() * scale;
    let yaw = config.yaw_sigma_deg.to_radians().powi(2);
    let covariance = shape + Matrix3::from_diagonal(&Vector3::new(0.0, 0.0, yaw));
    covariance
        .iter()
        .all(|v| v.is_finite())
        .then_some(covariance)
}

/// The covariance of a motion predicted at constant velocity, whose acceleration is within the limits.
pub(super) fn of_prediction(interval_s: f64, config: &RefinementConfig) -> Matrix3<f64> {
    let variance =
        |jitter: f64, acceleration: f64| (jitter + acceleration * interval_s.powi(2)).powi(2) / 3.0;
    let shift = variance(config.jitter_m, config.acceleration_mps2);
    let turn = variance(
        config.jitter_deg.to_radians(),
        config.yaw_acceleration_degps2.to_radians(),
    );
    Matrix3::from_diagonal(&Vector3::new(shift, shift, turn))
}
