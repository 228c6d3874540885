//! Segment error (seg): the ATE of each segment of 100 to 800 m, relative to its length.

use std::num::NonZeroUsize;

use serde::Serialize;

use crate::evaluation::{MatchedPoses, ate::aligned_rmse_m, segments::PerLength};

/// The RMSE of the positions of a segment after its own SE(2) alignment, in % of its length.
///
/// Unlike the KITTI errors it uses no heading, so it is valid where the ground truth has a poor
/// heading or none.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Seg {
    /// Mean over all segments of all lengths, % of the segment length.
    pub percent: f64,
    pub segments: usize,
    /// Poses from the start of a segment to the start of the next.
    pub step: NonZeroUsize,
    /// The means for each length that has segments, shortest first.
    pub by_length: Vec<SegLength>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SegLength {
    pub length_m: f64,
    /// Mean RMSE, % of the segment length.
    pub percent: f64,
    pub segments: usize,
}

/// Returns the mean error of the segments of [`kitti`](crate::evaluation::kitti::kitti), each
/// aligned separately; `None` if the path is not longer than 100 m.
pub fn seg(matched: &MatchedPoses, step: NonZeroUsize) -> Option<Seg> {
    let errors = PerLength::of(matched, step, |segment| {
        let range = segment.first..=segment.last;
        let rmse_m = aligned_rmse_m(&matched.estimate()[range.clone()], &matched.truth()[range]);
        [100.0 * rmse_m / segment.length_m()]
    });
    let ([percent], segments) = errors.mean()?;
    let by_length = errors.means();
    let by_length = by_length.map(|(length_m, [percent], segments)| SegLength {
        length_m,
        percent,
        segments,
    });
    Some(Seg {
        percent,
        segments,
        step,
        by_length: by_length.collect(),
    })
}
