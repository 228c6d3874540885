//! Estimated poses with their associated ground-truth poses: the input of all metrics.

use gyre_geometry::Pose;

use crate::evaluation::{EvaluationError, error::LARGEST_COORDINATE_M};

/// Estimated and ground-truth poses, associated by index: valid, at least two, equally many, as
/// [`associate`](crate::evaluation::associate()) makes them. The fixed frames may differ.
#[derive(Debug, Clone, PartialEq)]
pub struct MatchedPoses {
    estimate: Vec<Pose>,
    truth: Vec<Pose>,
}

impl MatchedPoses {
    pub fn new(estimate: Vec<Pose>, truth: Vec<Pose>) -> Self {
        Self { estimate, truth }
    }

    pub fn estimate(&self) -> &[Pose] {
        &self.estimate
    }

    pub fn truth(&self) -> &[Pose] {
        &self.truth
    }

    /// The pairs (estimate, ground truth).
    pub fn iter(&self) -> impl Iterator<Item = (&Pose, &Pose)> {
        self.estimate.iter().zip(&self.truth)
    }

    /// The number of pairs, at least 2.
    #[allow(clippy::len_without_is_empty)] // never empty
    pub fn len(&self) -> usize {
        self.truth.len()
    }

    /// The distance travelled along the ground truth up to each pose, m; the first is 0.
    pub fn distance_m(&self) -> Vec<f64> {
        let mut travelled = 0.0;
        let add = |step| {
            travelled += step;
            travelled
        };
        let steps_m = std::iter::once(0.0).chain(steps_m(&self.truth));
        steps_m.map(add).collect()
    }

    pub(crate) fn map_estimate(self, change: impl FnMut(&Pose) -> Pose) -> Self {
        Self {
            estimate: self.estimate.iter().map(change).collect(),
            truth: self.truth,
        }
    }
}

/// The largest distance of (cosine, sine) from the unit circle: rounding in text files stays below.
const LARGEST_ROUNDING: f64 = 1e-3;

/// Refuses positions that are not finite or too far out, and invalid rotations.
pub(crate) fn require_poses(side: &str, poses: &[Pose]) -> Result<(), EvaluationError> {
    for (index, pose) in poses.iter().enumerate() {
        let (x_m, y_m) = (pose.translation.x, pose.translation.y);
        // NaN fails these comparisons.
        let within = |v: f64| v.abs() <= LARGEST_COORDINATE_M;
        if !(within(x_m) && within(y_m)) {
            return Err(EvaluationError(format!(
                "the position of pose {index} of the {side} is not within {LARGEST_COORDINATE_M:e} m: ({x_m}, {y_m})"
            )));
        }
        let length = pose.rotation.complex().norm();
        let on_circle = (length - 1.0).abs() <= LARGEST_ROUNDING;
        if !on_circle {
            return Err(EvaluationError(format!(
                "the rotation of pose {index} of the {side} is invalid: its cosine and sine have length {length}, not 1"
            )));
        }
    }
    Ok(())
}

fn steps_m(poses: &[Pose]) -> impl Iterator<Item = f64> + '_ {
    let step = |w: &[Pose]| (w[1].translation.vector - w[0].translation.vector).norm();
    poses.windows(2).map(step)
}

pub fn path_m(poses: &[Pose]) -> f64 {
    steps_m(poses).sum()
}
