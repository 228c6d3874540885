//! Segment error: the shape of each 100 to 800 m stretch, judged by positions alone.

use std::num::NonZeroUsize;

use serde::Serialize;

use crate::{
    MatchedPoses,
    ate::aligned_rmse_m,
    stretches::{PerLength, stretches},
};

/// RMSE of positions within a stretch after the stretch's own SE(2) alignment, as a share of its length.
///
/// Unlike KITTI's figures it needs no heading in the truth, so it stays trustworthy where that heading is poor.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Seg {
    /// Mean over all stretches of all lengths, % of the nominal length.
    pub percent: f64,
    /// Number of stretches in the mean.
    pub stretches: usize,
    /// Poses between the starts of stretches.
    pub step: NonZeroUsize,
    /// The means of each length that has stretches, short lengths first.
    pub by_length: Vec<SegLength>,
}

/// Segment error of the stretches of one nominal length.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SegLength {
    /// Nominal length, m.
    pub length_m: f64,
    /// Mean RMSE, % of the nominal length.
    pub percent: f64,
    /// Number of stretches in the mean.
    pub stretches: usize,
}

/// Aligns every stretch that begins at every `step`-th pose by itself; `None` where the path has no stretch beyond
/// 100 m. The stretches are those of [`kitti`](crate::kitti::kitti).
pub fn seg(matched: &MatchedPoses, step: NonZeroUsize) -> Option<Seg> {
    let mut errors = PerLength::new();
    for stretch in stretches(&matched.distance_m(), step) {
        let range = stretch.first..=stretch.last;
        let rmse_m = aligned_rmse_m(&matched.estimate()[range.clone()], &matched.truth()[range]);
        errors.add(stretch.length, [100.0 * rmse_m / stretch.length_m()]);
    }
    let ([percent], stretches) = errors.mean()?;
    let by_length = errors
        .means()
        .map(|(length_m, [percent], stretches)| SegLength {
            length_m,
            percent,
            stretches,
        });
    Some(Seg {
        percent,
        stretches,
        step,
        by_length: by_length.collect(),
    })
}
