//! Absolute trajectory error (ATE): distances of positions from the ground truth after SE(2)
//! alignment.
//!
//! Sturm et al., "A benchmark for the evaluation of RGB-D SLAM systems", IROS 2012, in the plane;
//! the alignment has no scale.

use gyre_geometry::{Pose, xy_yaw};
use nalgebra::Vector2;
use serde::{Serialize, Serializer};

use crate::evaluation::MatchedPoses;

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Ate {
    /// Root of the mean squared distance, m: the figure that papers give.
    pub rmse_m: f64,
    pub mean_m: f64,
    pub max_m: f64,
    /// The alignment: the fixed frame of the estimate in the fixed frame of the ground truth.
    #[serde(serialize_with = "serialize_isometry")]
    pub truth_from_estimate: Pose,
}

/// Returns the distances between the positions of the ground truth and of the aligned estimate.
pub fn ate(matched: &MatchedPoses) -> Ate {
    let truth_from_estimate = align(matched);
    let distance = |(e, t): (&Pose, &Pose)| distance_m(&truth_from_estimate, e, t);
    let distances = || matched.iter().map(distance);
    let n = matched.len() as f64;
    Ate {
        rmse_m: (distances().map(|d| d * d).sum::<f64>() / n).sqrt(),
        mean_m: distances().sum::<f64>() / n,
        max_m: distances().fold(0.0, f64::max),
        truth_from_estimate,
    }
}

/// Returns the rigid motion that aligns the positions of the estimate with the ground truth by
/// least squares. Headings are not used. If the positions do not define the rotation (all in one
/// place), it is 0.
pub fn align(matched: &MatchedPoses) -> Pose {
    align_positions(matched.estimate(), matched.truth())
}

/// Returns the RMSE (m) of the positions after their alignment; both slices have the same length,
/// at least 1.
pub(crate) fn aligned_rmse_m(estimate: &[Pose], truth: &[Pose]) -> f64 {
    let truth_from_estimate = align_positions(estimate, truth);
    let square = |(e, t)| distance_m(&truth_from_estimate, e, t).powi(2);
    (estimate.iter().zip(truth).map(square).sum::<f64>() / truth.len() as f64).sqrt()
}

/// Returns the least-squares alignment in closed form: the angle that maximises sum(t . R e) over
/// centred positions is atan2(sum of cross products, sum of dot products).
fn align_positions(estimate: &[Pose], truth: &[Pose]) -> Pose {
    align_about(centroid(estimate), centroid(truth), estimate, truth)
}

/// Returns the least-squares alignment that takes the position `e0` to `t0`.
pub(crate) fn align_about(
    e0: Vector2<f64>,
    t0: Vector2<f64>,
    estimate: &[Pose],
    truth: &[Pose],
) -> Pose {
    let (mut cross, mut dot) = (0.0, 0.0);
    for (e, t) in estimate.iter().zip(truth) {
        let (e, t) = (e.translation.vector - e0, t.translation.vector - t0);
        cross += e.perp(&t);
        dot += e.dot(&t);
    }
    let rotation = nalgebra::UnitComplex::new(cross.atan2(dot));
    Pose::from_parts((t0 - rotation * e0).into(), rotation)
}

fn centroid(poses: &[Pose]) -> Vector2<f64> {
    let positions = poses.iter().map(|p| p.translation.vector);
    positions.sum::<Vector2<f64>>() / poses.len() as f64
}

fn distance_m(truth_from_estimate: &Pose, estimate: &Pose, truth: &Pose) -> f64 {
    let aligned = truth_from_estimate * nalgebra::Point2::from(estimate.translation.vector);
    (aligned.coords - truth.translation.vector).norm()
}

/// Writes a pose as `{ x_m, y_m, yaw_rad }`.
fn serialize_isometry<S: Serializer>(pose: &Pose, serializer: S) -> Result<S::Ok, S::Error> {
    let [x_m, y_m, yaw_rad] = xy_yaw(pose);
    serializer.collect_map([("x_m", x_m), ("y_m", y_m), ("yaw_rad", yaw_rad)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use gyre_geometry::pose;

    #[test]
    fn two_points_share_the_error_of_their_distance() {
        let at = |x| pose(x, 0.0, 0.0);
        let matched = MatchedPoses::new(vec![at(10.0), at(14.0)], vec![at(-1.0), at(1.0)]);
        let ate = ate(&matched);
        assert_eq!((ate.rmse_m, ate.mean_m, ate.max_m), (1.0, 1.0, 1.0));
        assert_eq!(ate.truth_from_estimate, at(-12.0));
    }

    #[test]
    fn a_standing_estimate_is_translated_but_not_rotated() {
        let truth: Vec<_> = (0..5).map(|k| pose(f64::from(k), 3.0, 1.0)).collect();
        let matched = MatchedPoses::new(vec![Pose::identity(); 5], truth);
        assert_eq!(align(&matched), pose(2.0, 3.0, 0.0));
        assert!((ate(&matched).rmse_m - 2f64.sqrt()).abs() < 1e-12);
    }
}
