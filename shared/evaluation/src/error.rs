//! What can be wrong with the input of an evaluation.

use std::fmt;

/// Which of the two trajectories is meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// The trajectory that is judged.
    Estimate,
    /// The trajectory that it is held against.
    Truth,
}

impl fmt::Display for Side {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Side::Estimate => "estimate",
            Side::Truth => "ground truth",
        })
    }
}

/// Largest coordinate that counts as a position, m: map projections stay far below.
pub(crate) const LARGEST_COORDINATE_M: f64 = 1e9;

/// Why two trajectories cannot be compared.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EvaluationError {
    /// A position is NaN, infinite, or further out than any vehicle drives.
    #[error("the position of pose {index} of the {side} is not within {limit:e} m: ({x_m}, {y_m})", limit = LARGEST_COORDINATE_M)]
    BadPosition {
        /// Whose pose.
        side: Side,
        /// Its index, from 0.
        index: usize,
        /// Its x, m.
        x_m: f64,
        /// Its y, m.
        y_m: f64,
    },
    /// The rotation of a pose is none: its cosine and sine do not lie on the unit circle.
    #[error(
        "pose {index} of the {side} has no rotation: its cosine and sine have length {length}, not 1"
    )]
    NotARotation {
        /// Whose pose.
        side: Side,
        /// Its index, from 0.
        index: usize,
        /// Length of (cosine, sine).
        length: f64,
    },
    /// Association by time needs one stamp a pose.
    #[error("the {side} has {poses} poses but {stamps} stamps")]
    StampCount {
        /// Whose stamps.
        side: Side,
        /// Poses given.
        poses: usize,
        /// Stamps given.
        stamps: usize,
    },
    /// Stamps run backwards.
    #[error(
        "the stamps of the {side} run backwards at pose {index}: {stamp_ns} ns after {previous_ns} ns"
    )]
    Backwards {
        /// Whose stamps.
        side: Side,
        /// Index of the pose whose stamp is earlier than the one before.
        index: usize,
        /// The stamp before, ns.
        previous_ns: i64,
        /// The offending stamp, ns.
        stamp_ns: i64,
    },
    /// No pose of the estimate lies within the time span of the truth.
    #[error(
        "estimate and ground truth do not overlap in time: {} against {} (same clock, same unit?)",
        span_s(.estimate_ns),
        span_s(.truth_ns)
    )]
    NoOverlap {
        /// First and last stamp of the estimate, ns.
        estimate_ns: (i64, i64),
        /// First and last stamp of the truth, ns.
        truth_ns: (i64, i64),
    },
    /// Fewer than two poses have a counterpart: there is no motion to judge.
    #[error(
        "{matched} of {estimate} estimated poses have a counterpart among the {truth} of the ground truth; at least 2 are needed"
    )]
    TooFew {
        /// Poses with a counterpart.
        matched: usize,
        /// Poses of the estimate.
        estimate: usize,
        /// Poses of the truth.
        truth: usize,
    },
    /// Poses that are to be compared one by one are not equally many.
    #[error(
        "{estimate} estimated poses cannot be held one by one against {truth} of the ground truth"
    )]
    LengthMismatch {
        /// Poses of the estimate.
        estimate: usize,
        /// Poses of the truth.
        truth: usize,
    },
    /// The numbers of a motion are NaN, infinite, or further than any vehicle drives.
    #[error("motion {index} is none: ({x_m} m, {y_m} m, {yaw_rad} rad)")]
    NotAMotion {
        /// Its index, from 0.
        index: usize,
        /// Its x, m.
        x_m: f64,
        /// Its y, m.
        y_m: f64,
        /// Its yaw, rad.
        yaw_rad: f64,
    },
    /// A motion does not end after it begins, or begins before the one before has ended.
    #[error(
        "the motions run backwards at motion {index}: from {from_ns} ns to {to_ns} ns, after {previous_ns} ns"
    )]
    MotionBackwards {
        /// Its index, from 0.
        index: usize,
        /// End of the motion before, ns; for the first motion its own beginning.
        previous_ns: i64,
        /// Its earlier stamp, ns.
        from_ns: i64,
        /// Its later stamp, ns.
        to_ns: i64,
    },
    /// Covariances cannot be judged: there is not one motion with truth and covariance.
    #[error(
        "none of {motions} motions can be judged: {without_truth} without ground truth at both ends (same clock?), \
         {without_covariance} without a positive definite covariance"
    )]
    NoMatchedMotion {
        /// Motions given.
        motions: usize,
        /// Motions without truth at both ends.
        without_truth: usize,
        /// Motions without a positive definite covariance.
        without_covariance: usize,
    },
}

fn span_s(span_ns: &(i64, i64)) -> String {
    format!(
        "{:.3} s to {:.3} s",
        span_ns.0 as f64 * 1e-9,
        span_ns.1 as f64 * 1e-9
    )
}
