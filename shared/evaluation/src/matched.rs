//! Estimated poses with their associated ground-truth poses: the input of all metrics.

use gyre_geometry::Pose;

use crate::{EvaluationError, Side, error::LARGEST_COORDINATE_M};

/// Estimated and ground-truth poses, associated by index: valid, at least two, equally many. The
/// fixed frames may differ.
#[derive(Debug, Clone, PartialEq)]
pub struct MatchedPoses {
    estimate: Vec<Pose>,
    truth: Vec<Pose>,
}

impl MatchedPoses {
    /// Associates the poses one by one.
    pub fn new(estimate: Vec<Pose>, truth: Vec<Pose>) -> Result<Self, EvaluationError> {
        let (n, m) = (estimate.len(), truth.len());
        if n != m {
            return Err(EvaluationError::LengthMismatch {
                estimate: n,
                truth: m,
            });
        }
        if n < 2 {
            return Err(EvaluationError::TooFew {
                matched: n,
                estimate: n,
                truth: m,
            });
        }
        require_poses(Side::Estimate, &estimate)?;
        require_poses(Side::Truth, &truth)?;
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
        std::iter::once(0.0)
            .chain(steps_m(&self.truth))
            .map(add)
            .collect()
    }

    /// Applies `change`, which must keep poses valid, to each estimated pose.
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
pub(crate) fn require_poses(side: Side, poses: &[Pose]) -> Result<(), EvaluationError> {
    for (index, pose) in poses.iter().enumerate() {
        let (x_m, y_m) = (pose.translation.x, pose.translation.y);
        // NaN fails these comparisons.
        let within = |v: f64| v.abs() <= LARGEST_COORDINATE_M;
        if !(within(x_m) && within(y_m)) {
            return Err(EvaluationError::BadPosition {
                side,
                index,
                x_m,
                y_m,
            });
        }
        let length = pose.rotation.complex().norm();
        let on_circle = (length - 1.0).abs() <= LARGEST_ROUNDING;
        if !on_circle {
            return Err(EvaluationError::BadRotation {
                side,
                index,
                length,
            });
        }
    }
    Ok(())
}

/// The distances from pose to pose, m.
fn steps_m(poses: &[Pose]) -> impl Iterator<Item = f64> + '_ {
    poses
        .windows(2)
        .map(|w| (w[1].translation.vector - w[0].translation.vector).norm())
}

/// The length of the path, m.
pub fn path_m(poses: &[Pose]) -> f64 {
    steps_m(poses).sum()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use gyre_geometry::pose;

    #[test]
    fn lists_of_unequal_length_or_below_two_poses_are_refused() {
        let still = Pose::identity();
        assert_eq!(
            MatchedPoses::new(vec![still; 3], vec![still; 2]),
            Err(EvaluationError::LengthMismatch {
                estimate: 3,
                truth: 2
            })
        );
        assert_eq!(
            MatchedPoses::new(vec![still], vec![still]),
            Err(EvaluationError::TooFew {
                matched: 1,
                estimate: 1,
                truth: 1
            })
        );
    }

    #[test]
    fn an_invalid_position_is_refused_with_its_index() {
        for x in [f64::NAN, f64::INFINITY, -2e9] {
            let mut poses = vec![Pose::identity(); 3];
            poses[2].translation.x = x;
            let error = MatchedPoses::new(vec![Pose::identity(); 3], poses).unwrap_err();
            assert!(matches!(
                error,
                EvaluationError::BadPosition {
                    side: Side::Truth,
                    index: 2,
                    ..
                }
            ));
        }
    }

    #[test]
    fn a_rotation_off_the_unit_circle_is_refused_beyond_rounding() {
        let scaled = |length: f64| {
            let rotation = nalgebra::Unit::new_unchecked(nalgebra::Complex::new(0.0, length));
            MatchedPoses::new(
                vec![Pose::from_parts(Default::default(), rotation); 2],
                vec![Pose::identity(); 2],
            )
        };
        assert!(scaled(1.0 + 1e-6).is_ok());
        let refused = EvaluationError::BadRotation {
            side: Side::Estimate,
            index: 0,
            length: 0.5,
        };
        assert_eq!(scaled(0.5), Err(refused));
    }

    #[test]
    fn distance_is_the_path_length_of_the_ground_truth() {
        let at = |x, y| pose(x, y, 0.0);
        let matched = MatchedPoses::new(
            vec![at(0.0, 0.0); 3],
            vec![at(1.0, 1.0), at(4.0, 5.0), at(4.0, 3.0)],
        )
        .unwrap();
        assert_eq!(matched.distance_m(), [0.0, 5.0, 7.0]);
    }
}
