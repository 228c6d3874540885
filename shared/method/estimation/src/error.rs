//! Errors of the estimators.

use thiserror::Error;

/// Errors of [`TrajectoryFilter`](crate::TrajectoryFilter) and [`PoseGraph`](crate::PoseGraph). An
/// estimator that returns one is unchanged.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum EstimationError {
    #[error(
        "the constraint from keyframe {from} to {to} names a keyframe that has not been added: there are {keyframes}, counted \
         from 0. Add odometry constraints in the order of the keyframes, and loops after both of their keyframes"
    )]
    UnknownKeyframe {
        /// The keyframe that the motion is measured from.
        from: usize,
        /// The keyframe that is measured.
        to: usize,
        keyframes: usize,
    },
    /// An odometry constraint does not lead from the last keyframe to a new one.
    #[error(
        "the odometry constraint from keyframe {from} to {to} does not continue the trajectory: it must lead from the last keyframe, \
         {last}, to the next one"
    )]
    Discontinuous {
        /// The keyframe that the motion is measured from.
        from: usize,
        /// The keyframe that is measured.
        to: usize,
        last: usize,
    },
    #[error(
        "the constraint of keyframe {0} with itself says nothing: a constraint needs two keyframes"
    )]
    SameKeyframe(usize),
    #[error("the motion measured from keyframe {from} to {to} is not finite")]
    NotFinite {
        /// The keyframe that the motion is measured from.
        from: usize,
        /// The keyframe that is measured.
        to: usize,
    },
    #[error(
        "the covariance of the motion from keyframe {from} to {to} is not positive definite: every measured motion needs the \
         uncertainty of its x, y and yaw"
    )]
    Covariance {
        /// The keyframe that the motion is measured from.
        from: usize,
        /// The keyframe that is measured.
        to: usize,
    },
    #[error(
        "the position measured at keyframe {keyframe} is not finite, or its variance or share is not above zero"
    )]
    Position { keyframe: usize },
    #[error(
        "the trajectory filter is full: it holds {limit} keyframes, with a covariance of {} MB. Use the pose graph for a longer \
         trajectory, or raise the limit",
        72 * limit * limit / 1_000_000
    )]
    TooManyKeyframes {
        /// The largest number of keyframes.
        limit: usize,
    },
    #[error("there is no keyframe {keyframe}: there are {keyframes}, counted from 0")]
    NoKeyframe { keyframe: usize, keyframes: usize },
    /// The number of poses to start from differs from the number of keyframes of the graph.
    #[error(
        "there are {poses} poses to start from, and {keyframes} keyframes: each keyframe needs one"
    )]
    StartPoses { poses: usize, keyframes: usize },
    #[error(
        "the constraints do not determine the poses: covariances differ by too many orders of magnitude, or poses are beyond the range          of numbers"
    )]
    Singular,
    #[error("there is not enough memory for the equations of {keyframes} keyframes")]
    Memory { keyframes: usize },
}
