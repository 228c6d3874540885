//! Errors of an evaluation's input.

use std::fmt;

/// One of the two trajectories.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// The trajectory that is evaluated.
    Estimate,
    /// The trajectory that it is compared with.
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

/// The largest coordinate of a position, m: map projections stay far below.
pub(crate) const LARGEST_COORDINATE_M: f64 = 1e9;

/// The reason why two trajectories cannot be compared.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages explain the variants and fields")]
pub enum EvaluationError {
    #[error("the position of pose {index} of the {side} is not within {limit:e} m: ({x_m}, {y_m})", limit = LARGEST_COORDINATE_M)]
    BadPosition {
        side: Side,
        index: usize,
        x_m: f64,
        y_m: f64,
    },
    /// The cosine and sine of a pose do not lie on the unit circle.
    #[error(
        "the rotation of pose {index} of the {side} is invalid: its cosine and sine have length {length}, not 1"
    )]
    BadRotation {
        side: Side,
        index: usize,
        length: f64,
    },
    #[error("the {side} has {poses} poses but {stamps} stamps")]
    StampCount {
        side: Side,
        poses: usize,
        stamps: usize,
    },
    #[error(
        "the stamps of the {side} decrease at pose {index}: {stamp_ns} ns after {previous_ns} ns"
    )]
    DecreasingStamps {
        side: Side,
        index: usize,
        previous_ns: i64,
        stamp_ns: i64,
    },
    /// No pose of the estimate lies within the time span of the ground truth.
    #[error(
        "the trajectories do not overlap in time: estimate {}, ground truth {} (same clock, same unit?)",
        span_s(.estimate_ns),
        span_s(.truth_ns)
    )]
    NoOverlap {
        estimate_ns: (i64, i64),
        truth_ns: (i64, i64),
    },
    #[error(
        "{matched} of {estimate} estimated poses could be associated with the {truth} poses of the ground truth; at least 2 are needed"
    )]
    TooFew {
        matched: usize,
        estimate: usize,
        truth: usize,
    },
    #[error(
        "{estimate} estimated poses cannot be compared one by one with {truth} poses of the ground truth"
    )]
    LengthMismatch { estimate: usize, truth: usize },
    #[error("motion {index} is invalid: ({x_m} m, {y_m} m, {yaw_rad} rad)")]
    BadMotion {
        index: usize,
        x_m: f64,
        y_m: f64,
        yaw_rad: f64,
    },
    /// A motion does not end after its start, or starts before the end of the one before.
    #[error(
        "motion {index} is out of order: from {from_ns} ns to {to_ns} ns, after {previous_ns} ns"
    )]
    MotionOutOfOrder {
        index: usize,
        /// End of the motion before, ns; for the first motion its own start.
        previous_ns: i64,
        from_ns: i64,
        to_ns: i64,
    },
    #[error(
        "none of {motions} motions has ground truth and covariance: {without_truth} without ground truth at both ends \
         (same clock?), {without_covariance} without a positive definite covariance"
    )]
    NoMatchedMotion {
        motions: usize,
        without_truth: usize,
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
