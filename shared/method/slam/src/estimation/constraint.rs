use gyre_geometry::UncertainMotion;
use nalgebra::{Matrix3, Vector3};

use crate::estimation::EstimationError;

/// The 99.9 % quantile of the chi-square distribution with three degrees of freedom: the default
/// gate of loops.
pub const CHI_SQUARE_99_9: f64 = 16.266;

/// The 99.9 % quantile with two degrees of freedom: the gate of positions.
pub const CHI_SQUARE_99_9_PLANE: f64 = 13.816;

/// A measured relative pose of two keyframes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Constraint {
    /// Keyframes are counted from 0.
    pub from: usize,
    /// The keyframe whose pose is measured. A loop may lead from the later keyframe to the earlier
    /// one.
    pub to: usize,
    /// The pose of keyframe `to` in the frame of keyframe `from`, and the covariance of its (x, y,
    /// yaw) along the axes of `from`.
    pub motion: UncertainMotion,
    pub kind: Kind,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// The motion from the last keyframe to a new one. It is never rejected.
    Odometry,
    /// A registration of two keyframes of the same place. It is tested, and may be wrong.
    Loop {
        /// Loops of one group have dependent errors, for instance all loops along the same 20 m of
        /// a revisit. `None` for a loop whose error is independent of all others.
        group: Option<u64>,
    },
}

impl Constraint {
    pub fn odometry(from: usize, motion: UncertainMotion) -> Self {
        Self {
            from,
            to: from + 1,
            motion,
            kind: Kind::Odometry,
        }
    }

    pub fn closing(from: usize, to: usize, motion: UncertainMotion) -> Self {
        Self {
            from,
            to,
            motion,
            kind: Kind::Loop { group: None },
        }
    }

    pub(crate) fn check(&self, keyframes: usize) -> Result<(), EstimationError> {
        let &Self { from, to, .. } = self;
        let last = keyframes - 1;
        let [x, y, yaw] = gyre_geometry::xy_yaw(&self.motion.motion);
        let is_finite = x.is_finite() && y.is_finite() && yaw.is_finite();
        let refusal = match self.kind {
            _ if from == to => format!(
                "the constraint of keyframe {from} with itself is empty: a constraint needs two keyframes"
            ),
            Kind::Odometry if (from, to) != (last, last + 1) => format!(
                "the odometry constraint from keyframe {from} to {to} does not continue the trajectory: it must lead from the last \
                 keyframe, {last}, to the next one"
            ),
            Kind::Loop { .. } if from.max(to) > last => {
                return Err(EstimationError::unknown([from, to], keyframes));
            }
            _ if !is_finite => {
                format!("the motion measured from keyframe {from} to {to} is not finite")
            }
            _ if !self.motion.has_covariance() => format!(
                "the covariance of the motion from keyframe {from} to {to} is not positive definite: every measured motion needs the \
                 uncertainty of its x, y and yaw"
            ),
            _ => return Ok(()),
        };
        Err(EstimationError::Refused(refusal))
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Verdict {
    /// Squared normalised difference of the measured motion from the predicted one; 3 is expected
    /// of a right loop.
    pub chi_square: f64,
    pub outcome: Outcome,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    Accepted,
    Rejected,
    /// The constraint agrees with the estimate, and its group has been counted in full: it is not
    /// part of the estimate.
    Redundant,
}

pub(crate) fn keyframe_exists(keyframe: usize, keyframes: usize) -> Result<(), EstimationError> {
    match keyframe < keyframes {
        true => Ok(()),
        false => Err(EstimationError::Refused(format!(
            "there is no keyframe {keyframe}: there are {keyframes}, counted from 0"
        ))),
    }
}

/// Returns the squared length of `residual` normalised by `covariance`; infinite if the covariance
/// is not positive definite.
pub fn chi_square(residual: &Vector3<f64>, covariance: &Matrix3<f64>) -> f64 {
    covariance.cholesky().map_or(f64::INFINITY, |factor| {
        residual.dot(&factor.solve(residual))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use gyre_geometry::pose;

    fn motion(x_m: f64) -> UncertainMotion {
        UncertainMotion {
            motion: pose(x_m, 0.0, 0.0),
            covariance: Matrix3::identity(),
        }
    }

    #[test]
    fn constraints_that_no_estimator_can_take_are_refused_with_the_reason() {
        let flat = UncertainMotion {
            covariance: Matrix3::zeros(),
            ..motion(1.0)
        };
        let nan = motion(f64::NAN);
        for (constraint, expected) in [
            (Constraint::odometry(1, motion(1.0)), "does not continue"),
            (Constraint::closing(5, 0, motion(1.0)), "there are 5"),
            (Constraint::closing(3, 3, motion(1.0)), "with itself"),
            (Constraint::closing(0, 3, nan), "is not finite"),
            (Constraint::closing(0, 3, flat), "not positive definite"),
        ] {
            let refused = constraint.check(5).unwrap_err().to_string();
            assert!(refused.contains(expected), "{refused}");
        }
        assert_eq!(Constraint::odometry(4, motion(1.0)).check(5), Ok(()));
        assert_eq!(Constraint::closing(4, 0, motion(1.0)).check(5), Ok(()));
    }
}
