//! Covariances from the shapes of peaks.

use nalgebra::{Matrix2, Matrix3, Rotation2, Vector2};

/// The covariance of a shift, m^2: (1 - score) over the peak's curvature, scaled; at most `guess`,
/// the variance without a match.
///
/// `hessian` holds the second derivatives of the score per squared cell.
pub(crate) fn shift_covariance(
    variance_scale: f64,
    score: f64,
    hessian: &Matrix2<f64>,
    cell_m: f64,
    guess: f64,
) -> Matrix2<f64> {
    let scale = variance_scale * (1.0 - score).max(1e-6) * cell_m.powi(2);
    match (-hessian).try_inverse() {
        Some(shape)
            if shape.trace() > 0.0
                && shape.determinant() > 0.0
                && shape.trace() * scale < guess =>
        {
            shape * scale
        }
        _ => Matrix2::identity() * guess,
    }
}

/// The covariance of (x, y, yaw) from the covariance of the shift along the later scan's axes at a
/// known angle, the variance of the angle, and the derivative of (x, y) by the angle, m/rad.
pub(crate) fn motion_covariance(
    turn: &Rotation2<f64>,
    shift: Matrix2<f64>,
    by_angle: Vector2<f64>,
    variance_rad2: f64,
) -> Matrix3<f64> {
    let placed = turn.matrix() * shift * turn.matrix().transpose();
    let mut covariance = Matrix3::zeros();
    covariance
        .fixed_view_mut::<2, 2>(0, 0)
        .copy_from(&(placed + by_angle * by_angle.transpose() * variance_rad2));
    covariance
        .fixed_view_mut::<2, 1>(0, 2)
        .copy_from(&(by_angle * variance_rad2));
    covariance
        .fixed_view_mut::<1, 2>(2, 0)
        .copy_from(&(by_angle.transpose() * variance_rad2));
    covariance[(2, 2)] = variance_rad2;
    covariance
}

/// The variance of a uniform distribution within `reach` to either side.
pub(crate) fn guess(reach: f64) -> f64 {
    reach.powi(2) / 3.0
}
