//! Estimated poses with their associated ground-truth poses: the input of all metrics.

use gyre_geometry::Pose;

use crate::evaluation::{
    EvaluationError,
    error::{ESTIMATE, LARGEST_COORDINATE_M, TRUTH},
};

/// Estimated and ground-truth poses, associated by index: valid, at least two, equally many. The
/// fixed frames may differ.
#[derive(Debug, Clone, PartialEq)]
pub struct MatchedPoses {
    estimate: Vec<Pose>,
    truth: Vec<Pose>,
}

impl MatchedPoses {
    pub fn new(estimate: Vec<Pose>, truth: Vec<Pose>) -> Result<Self, EvaluationError> {
        let (n, m) = (estimate.len(), truth.len());
        if n != m {
            return Err(EvaluationError(format!(
                "{n} estimated poses cannot be compared one by one with {m} poses of the ground truth"
            )));
        }
        if n < 2 {
            return Err(EvaluationError::too_few(n, [n, m]));
        }
        require_poses(ESTIMATE, &estimate)?;
        require_poses(TRUTH, &truth)?;
        Ok(Self { estimate, truth })
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

#[cfg(test)]
mod tests {
    use super::*;
    use gyre_geometry::pose;

    #[test]
    fn unequal_short_and_invalid_lists_are_refused_with_the_reason() {
        let still = Pose::identity();
        let far = |x| vec![still, pose(x, 0.0, 0.0)];
        let scaled = |length: f64| {
            let rotation = nalgebra::Unit::new_unchecked(nalgebra::Complex::new(0.0, length));
            vec![Pose::from_parts(Default::default(), rotation); 2]
        };
        let two = vec![still; 2];
        assert!(MatchedPoses::new(scaled(1.0 + 1e-6), two.clone()).is_ok());
        for (estimate, truth, words) in [
            (vec![still; 3], two.clone(), "one by one with 2 poses"),
            (vec![still], vec![still], "1 of 1 estimated"),
            (two.clone(), far(f64::NAN), "pose 1 of the ground truth"),
            (two.clone(), far(f64::INFINITY), "1 of the ground truth"),
            (far(-2e9), two.clone(), "pose 1 of the estimate"),
            (scaled(0.5), two, "rotation of pose 0 of the estimate"),
        ] {
            let refused = MatchedPoses::new(estimate, truth).unwrap_err().0;
            assert!(refused.contains(words), "{refused}");
        }
    }
}
