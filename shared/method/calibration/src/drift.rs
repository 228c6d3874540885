//! The drift between revisits: the track from one scan of a place to a later one must lead to the
//! registered relative pose of the two scans.

use gyre_geometry::{Pose, covariance, xy_yaw};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use crate::{Estimate, Track, revisits::Revisit};

/// Standard deviation of the relative pose of two scans of one place: m, m, rad.
const ALIGNMENT_SIGMA: [f64; 3] = [0.1, 0.1, 3e-3];
pub(crate) const MAX_REVISITS: usize = 80;

/// The residuals of all revisits: x, y (m) and yaw (rad) of the later scan as driven less as seen,
/// in the frame of the earlier one.
pub(crate) fn residuals(track: &Track, revisits: &[Revisit]) -> DVector<f64> {
    let rows = revisits.iter().flat_map(|revisit| {
        let driven = track.poses[revisit.earlier].inv_mul(&track.poses[revisit.later]);
        difference(&driven, &revisit.pose)
    });
    DVector::from_iterator(3 * revisits.len(), rows)
}

fn difference(driven: &Pose, seen: &Pose) -> [f64; 3] {
    let [x, y, _] = xy_yaw(driven);
    let [seen_x, seen_y, _] = xy_yaw(seen);
    let turn = (driven.rotation * seen.rotation.inverse()).angle();
    [x - seen_x, y - seen_y, turn]
}

/// Estimates the change of a fact that makes the revisits coincide: generalised least squares with
/// the residuals' `slopes` by the fact.
pub(crate) fn solve(
    track: &Track,
    revisits: &[Revisit],
    residuals: &DVector<f64>,
    slopes: &DVector<f64>,
) -> Option<Estimate> {
    let covariance = covariance(track, revisits);
    let factor = covariance.cholesky()?;
    let weighted = factor.solve(slopes);
    let information = weighted.dot(slopes);
    let value = -weighted.dot(residuals) / information;
    let left = residuals + slopes * value;
    // Residuals larger than the covariance widen it; smaller residuals do not narrow it.
    let excess = left.dot(&factor.solve(&left)) / (left.len().max(2) - 1) as f64;
    (information > 0.0).then(|| Estimate::new(value, (excess.max(1.0) / information).sqrt()))
}

fn covariance(track: &Track, revisits: &[Revisit]) -> DMatrix<f64> {
    let count = revisits.len();
    let mut all = DMatrix::zeros(3 * count, 3 * count);
    for motion in 1..track.motions.len() {
        let noise = track.motions[motion].covariance;
        let touched: Vec<(usize, Matrix3<f64>)> = revisits
            .iter()
            .enumerate()
            .filter(|(_, revisit)| revisit.earlier < motion && motion <= revisit.later)
            .map(|(k, revisit)| (k, effect(track, revisit, motion)))
            .collect();
        for (a, on_a) in &touched {
            for (b, on_b) in &touched {
                let mut block = all.fixed_view_mut::<3, 3>(3 * a, 3 * b);
                block += on_a * noise * on_b.transpose();
            }
        }
    }
    let own = Matrix3::from_diagonal(&Vector3::from(ALIGNMENT_SIGMA).map(|sigma| sigma * sigma));
    for k in 0..count {
        let mut block = all.fixed_view_mut::<3, 3>(3 * k, 3 * k);
        block += own;
    }
    all
}

fn effect(track: &Track, revisit: &Revisit, motion: usize) -> Matrix3<f64> {
    let base = &track.poses[revisit.earlier];
    let along = |scan: usize| base.inv_mul(&track.poses[scan]);
    let (start, at, end) = (along(motion - 1), along(motion), along(revisit.later));
    let lever = end.translation.vector - at.translation.vector;
    covariance::lever(lever.x, lever.y) * start.rotation.to_rotation_matrix().to_homogeneous()
}
