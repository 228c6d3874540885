//! Segment error: the shape of each 100 to 800 m segment, judged by positions alone.

use std::num::NonZeroUsize;

use serde::Serialize;

use crate::{
    MatchedPoses,
    ate::aligned_rmse_m,
    segments::{PerLength, segments},
};

/// RMSE of positions within a segment after the segment's own SE(2) alignment, as a share of its length.
///
/// Unlike KITTI's figures it needs no heading in the truth, so it stays trustworthy where that heading is poor.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Seg {
    /// Mean over all segments of all lengths, % of the nominal length.
    pub percent: f64,
    /// Number of segments in the mean.
    pub segments: usize,
    /// Poses between the starts of segments.
    pub step: NonZeroUsize,
    /// The means of each length that has segments, short lengths first.
    pub by_length: Vec<SegLength>,
}

/// Segment error of the segments of one nominal length.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SegLength {
    /// Nominal length, m.
    pub length_m: f64,
    /// Mean RMSE, % of the nominal length.
    pub percent: f64,
    /// Number of segments in the mean.
    pub segments: usize,
}

/// Aligns every segment that begins at every `step`-th pose by itself; `None` where the path has no segment beyond
/// 100 m. The segments are those of [`kitti`](crate::kitti::kitti).
pub fn seg(matched: &MatchedPoses, step: NonZeroUsize) -> Option<Seg> {
    let mut errors = PerLength::new();
    for segment in segments(&matched.distance_m(), step) {
        let range = segment.first..=segment.last;
        let rmse_m = aligned_rmse_m(&matched.estimate()[range.clone()], &matched.truth()[range]);
        errors.add(segment.length, [100.0 * rmse_m / segment.length_m()]);
    }
    let ([percent], segments) = errors.mean()?;
    let by_length = errors
        .means()
        .map(|(length_m, [percent], segments)| SegLength {
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
