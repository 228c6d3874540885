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
pub enum EvaluationError {
    /// A position is not finite, or further out than any vehicle drives.
    #[error("the position of pose {index} of the {side} is not within {limit:e} m: ({x_m}, {y_m})", limit = LARGEST_COORDINATE_M)]
    BadPosition {
        /// Whose pose.
        side: Side,
        /// The index, from 0.
        index: usize,
        /// The pose's x, m.
        x_m: f64,
        /// The pose's y, m.
        y_m: f64,
    },
    /// The cosine and sine of a pose do not lie on the unit circle.
    #[error(
        "the rotation of pose {index} of the {side} is invalid: its cosine and sine have length {length}, not 1"
    )]
    BadRotation {
        /// Whose pose.
        side: Side,
        /// The index, from 0.
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
    /// Stamps decrease.
    #[error(
        "the stamps of the {side} decrease at pose {index}: {stamp_ns} ns after {previous_ns} ns"
    )]
    DecreasingStamps {
        /// Whose stamps.
        side: Side,
        /// Index of the pose whose stamp is earlier than the one before.
        index: usize,
        /// The stamp before, ns.
        previous_ns: i64,
        /// The offending stamp, ns.
        stamp_ns: i64,
    },
    /// No pose of the estimate lies within the time span of the ground truth.
    #[error(
        "the trajectories do not overlap in time: estimate {}, ground truth {} (same clock, same unit?)",
        span_s(.estimate_ns),
        span_s(.truth_ns)
    )]
    NoOverlap {
        /// First and last stamp of the estimate, ns.
        estimate_ns: (i64, i64),
        /// First and last stamp of the ground truth, ns.
        truth_ns: (i64, i64),
    },
    /// Fewer than two poses are associated: there is no motion to compare.
    #[error(
        "{matched} of {estimate} estimated poses could be associated with the {truth} poses of the ground truth; at least 2 are needed"
    )]
    TooFew {
        /// Associated poses.
        matched: usize,
        /// Poses of the estimate.
        estimate: usize,
        /// Poses of the ground truth.
        truth: usize,
    },
    /// Poses that are to be compared one by one differ in number.
    #[error(
        "{estimate} estimated poses cannot be compared one by one with {truth} poses of the ground truth"
    )]
    LengthMismatch {
        /// Poses of the estimate.
        estimate: usize,
        /// Poses of the ground truth.
        truth: usize,
    },
    /// A motion is not finite, or further than any vehicle drives.
    #[error("motion {index} is invalid: ({x_m} m, {y_m} m, {yaw_rad} rad)")]
    BadMotion {
        /// The index, from 0.
        index: usize,
        /// The pose's x, m.
        x_m: f64,
        /// The pose's y, m.
        y_m: f64,
        /// The pose's yaw, rad.
        yaw_rad: f64,
    },
    /// A motion does not end after its start, or starts before the end of the one before.
    #[error(
        "motion {index} is out of order: from {from_ns} ns to {to_ns} ns, after {previous_ns} ns"
    )]
    MotionOutOfOrder {
        /// The index, from 0.
        index: usize,
        /// End of the motion before, ns; for the first motion its own start.
        previous_ns: i64,
        /// The earlier stamp, ns.
        from_ns: i64,
        /// The later stamp, ns.
        to_ns: i64,
    },
    /// No motion has both ground truth and a covariance.
    #[error(
        "none of {motions} motions has ground truth and covariance: {without_truth} without ground truth at both ends \
         (same clock?), {without_covariance} without a positive definite covariance"
    )]
    NoMatchedMotion {
        /// Motions given.
        motions: usize,
        /// Motions without ground truth at both ends.
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
