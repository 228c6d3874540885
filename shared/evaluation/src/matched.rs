//! Poses of the estimate, each with its counterpart in the truth: what all metrics work on.

use gyre_geometry::Pose;

use crate::{EvaluationError, Side, error::LARGEST_COORDINATE_M};

/// Two equally long lists of valid poses; pose `k` of one belongs to pose `k` of the other.
///
/// There are always at least two. The two lists may be in different fixed frames.
#[derive(Debug, Clone, PartialEq)]
pub struct MatchedPoses {
    estimate: Vec<Pose>,
    truth: Vec<Pose>,
}

impl MatchedPoses {
    /// Pairs the poses one by one.
    ///
    /// # Errors
    /// [`EvaluationError::LengthMismatch`], [`EvaluationError::TooFew`] below two poses,
    /// [`EvaluationError::BadPosition`] and [`EvaluationError::NotARotation`].
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

    /// The estimated poses.
    pub fn estimate(&self) -> &[Pose] {
        &self.estimate
    }

    /// The true poses.
    pub fn truth(&self) -> &[Pose] {
        &self.truth
    }

    /// Estimate and truth side by side.
    pub fn iter(&self) -> impl Iterator<Item = (&Pose, &Pose)> {
        self.estimate.iter().zip(&self.truth)
    }

    /// Number of pairs, at least 2.
    #[allow(clippy::len_without_is_empty)] // never empty
    pub fn len(&self) -> usize {
        self.truth.len()
    }

    /// Distance travelled along the truth up to each pose, m; the first is 0.
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

    /// The same pairs with each estimated pose passed through `change`, which must keep poses valid.
    pub(crate) fn map_estimate(self, change: impl FnMut(&Pose) -> Pose) -> Self {
        Self {
            estimate: self.estimate.iter().map(change).collect(),
            truth: self.truth,
        }
    }
}

/// Rotations may miss the unit circle by what text files round, and by no more than this.
const LARGEST_ROUNDING: f64 = 1e-3;

/// Refuses positions that are none (NaN, infinite, absurdly far) and rotations that are none.
pub(crate) fn require_poses(side: Side, poses: &[Pose]) -> Result<(), EvaluationError> {
    for (index, pose) in poses.iter().enumerate() {
        let (x_m, y_m) = (pose.translation.x, pose.translation.y);
        // NaN fails these comparisons
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
            return Err(EvaluationError::NotARotation {
                side,
                index,
                length,
            });
        }
    }
    Ok(())
}

/// Lengths of the steps from pose to pose, m.
fn steps_m(poses: &[Pose]) -> impl Iterator<Item = f64> + '_ {
    poses
        .windows(2)
        .map(|w| (w[1].translation.vector - w[0].translation.vector).norm())
}

/// Length of the whole path, m.
pub(crate) fn path_m(poses: &[Pose]) -> f64 {
    steps_m(poses).sum()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use gyre_geometry::pose;

    #[test]
    fn unequal_and_too_short_lists_are_refused_with_their_lengths() {
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
    fn a_position_that_is_none_is_named() {
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
        let refused = EvaluationError::NotARotation {
            side: Side::Estimate,
            index: 0,
            length: 0.5,
        };
        assert_eq!(scaled(0.5), Err(refused));
    }

    #[test]
    fn distance_adds_up_the_steps_of_the_truth() {
        let at = |x, y| pose(x, y, 0.0);
        let matched = MatchedPoses::new(
            vec![at(0.0, 0.0); 3],
            vec![at(1.0, 1.0), at(4.0, 5.0), at(4.0, 3.0)],
        )
        .unwrap();
        assert_eq!(matched.distance_m(), [0.0, 5.0, 7.0]);
    }
}
