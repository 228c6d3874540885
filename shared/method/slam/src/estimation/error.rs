use thiserror::Error;

/// Errors of [`TrajectoryFilter`](crate::estimation::TrajectoryFilter) and
/// [`PoseGraph`](crate::estimation::PoseGraph). An estimator that returns one is unchanged.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum EstimationError {
    /// A constraint or a position that no estimator can take, or a keyframe that is not there, with
    /// the reason.
    #[error("{0}")]
    Refused(String),
    #[error(
        "the trajectory filter is full: it holds {limit} keyframes, with a covariance of {} MB. Use the pose graph for a longer \
         trajectory, or raise the limit",
        72 * limit * limit / 1_000_000
    )]
    TooManyKeyframes { limit: usize },
    #[error(
        "the constraints do not determine the poses: covariances differ by too many orders of magnitude, or poses are beyond the range of numbers"
    )]
    Singular,
    #[error("there is not enough memory for the equations of {keyframes} keyframes")]
    Memory { keyframes: usize },
}

impl EstimationError {
    pub fn unknown([from, to]: [usize; 2], keyframes: usize) -> Self {
        Self::Refused(format!(
            "the constraint from keyframe {from} to {to} names a keyframe that has not been added: there are {keyframes}, counted \
             from 0. Add odometry constraints in the order of the keyframes, and loops after both of their keyframes"
        ))
    }
}
