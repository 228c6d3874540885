//! Relative pose error (RPE) with a delta of one pose.
//!
//! Sturm et al., "A benchmark for the evaluation of RGB-D SLAM systems", IROS 2012, in the plane.

use serde::Serialize;

use crate::evaluation::MatchedPoses;

/// The errors of the motions from each matched pose to the next.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Rpe {
    pub translation_rmse_m: f64,
    pub translation_mean_m: f64,
    pub rotation_rmse_deg: f64,
    /// Mean magnitude of the rotation error of a pair, degrees.
    pub rotation_mean_deg: f64,
    /// Estimated over true forward translation, both summed over the pairs; `None` if the ground
    /// truth moves forward by less than 1 m. It shows a wrong range resolution.
    pub forward_ratio: Option<f64>,
    /// All pairs in order; not serialised.
    #[serde(skip)]
    pub pairs: Vec<PairError>,
}

/// The error of the motion from one pose to the next.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PairError {
    /// Distance travelled along the ground truth up to the later pose, m.
    pub distance_m: f64,
    pub translation_m: f64,
    /// Rotation error with its sign (ground truth less estimate), degrees in (-180, 180].
    pub rotation_deg: f64,
}

const MIN_FORWARD_M: f64 = 1.0;

/// Compares the motion from each pose to the next with the true one.
pub fn rpe(matched: &MatchedPoses) -> Rpe {
    let (estimate, truth) = (matched.estimate(), matched.truth());
    let (mut forward_estimate, mut forward_truth) = (0.0, 0.0);
    let mut pairs = Vec::with_capacity(matched.len() - 1);
    for (k, &distance_m) in matched.distance_m().iter().enumerate().skip(1) {
        let estimated = estimate[k - 1].inv_mul(&estimate[k]);
        let actual = truth[k - 1].inv_mul(&truth[k]);
        let error = estimated.inv_mul(&actual);
        forward_estimate += estimated.translation.x;
        forward_truth += actual.translation.x;
        pairs.push(PairError {
            distance_m,
            translation_m: error.translation.vector.norm(),
            rotation_deg: error.rotation.angle().to_degrees(),
        });
    }
    let moves_forward = forward_truth >= MIN_FORWARD_M;
    Rpe {
        translation_rmse_m: rmse(pairs.iter().map(|p| p.translation_m)),
        translation_mean_m: mean(pairs.iter().map(|p| p.translation_m)),
        rotation_rmse_deg: rmse(pairs.iter().map(|p| p.rotation_deg)),
        rotation_mean_deg: mean(pairs.iter().map(|p| p.rotation_deg.abs())),
        forward_ratio: moves_forward.then(|| forward_estimate / forward_truth),
        pairs,
    }
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let n = values.len() as f64;
    values.sum::<f64>() / n
}

fn rmse(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    mean(values.map(|v| v * v)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use gyre_geometry::{Pose, pose};

    #[test]
    fn a_single_rotation_error_counts_once() {
        let chain = |turn_at: Option<usize>| {
            let mut here = Pose::identity();
            let turn = |k: usize| if Some(k) == turn_at { 0.1 } else { 0.0 };
            let step = |k: usize| {
                here *= pose(2.0, 0.0, turn(k));
                here
            };
            (0..11).map(step).collect::<Vec<_>>()
        };
        let rpe = rpe(&MatchedPoses::new(chain(Some(4)), chain(None)));
        let degrees = 0.1f64.to_degrees();
        assert_eq!(rpe.pairs.len(), 10);
        assert!((rpe.rotation_mean_deg - degrees / 10.0).abs() < 1e-9);
        assert!((rpe.rotation_rmse_deg - degrees / 10f64.sqrt()).abs() < 1e-9);
        assert!((rpe.pairs[3].rotation_deg + degrees).abs() < 1e-9);
        assert!(rpe.translation_rmse_m < 1e-9);
        assert!((rpe.forward_ratio.unwrap() - 1.0).abs() < 1e-12);
        assert_eq!(rpe.pairs[9].distance_m, 20.0);
    }

    #[test]
    fn standing_still_has_no_forward_ratio() {
        let still = vec![Pose::identity(); 4];
        let matched = MatchedPoses::new(still.clone(), still);
        assert_eq!(rpe(&matched).forward_ratio, None);
    }
}
