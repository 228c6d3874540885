//! The segments (KITTI: subsequences) of 100 to 800 m over which the KITTI errors and seg are
//! means.

use std::num::NonZeroUsize;

use crate::evaluation::MatchedPoses;

pub const SEGMENT_LENGTHS_M: [f64; 8] = [100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 700.0, 800.0];

/// One segment: from pose `first` to pose `last`, both included.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Segment {
    pub first: usize,
    pub last: usize,
    pub length: usize,
}

impl Segment {
    /// The length, m. As in the development kit errors are divided by it, not by the distance
    /// travelled.
    pub fn length_m(self) -> f64 {
        SEGMENT_LENGTHS_M[self.length]
    }
}

/// Returns all segments that start at every `step`-th pose and end at the first pose *beyond* the
/// length.
///
/// `distance_m` does not decrease. A length that the rest of the path does not exceed is skipped.
fn segments(distance_m: &[f64], step: NonZeroUsize) -> impl Iterator<Item = Segment> + '_ {
    let ends = move |first: usize| {
        (0..SEGMENT_LENGTHS_M.len()).filter_map(move |length| {
            let limit = distance_m[first] + SEGMENT_LENGTHS_M[length];
            let last = first + distance_m[first..].partition_point(|&d| d <= limit);
            (last < distance_m.len()).then_some(Segment {
                first,
                last,
                length,
            })
        })
    };
    (0..distance_m.len()).step_by(step.get()).flat_map(ends)
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct PerLength<const N: usize> {
    sums: [[f64; N]; SEGMENT_LENGTHS_M.len()],
    counts: [usize; SEGMENT_LENGTHS_M.len()],
}

impl<const N: usize> PerLength<N> {
    /// Sums the errors of all segments that start at every `step`-th pose.
    pub fn of(
        matched: &MatchedPoses,
        step: NonZeroUsize,
        error: impl Fn(Segment) -> [f64; N],
    ) -> Self {
        let mut of = Self {
            sums: [[0.0; N]; SEGMENT_LENGTHS_M.len()],
            counts: [0; SEGMENT_LENGTHS_M.len()],
        };
        for segment in segments(&matched.distance_m(), step) {
            of.counts[segment.length] += 1;
            let sums = of.sums[segment.length].iter_mut();
            sums.zip(error(segment))
                .for_each(|(sum, value)| *sum += value);
        }
        of
    }

    /// Returns the mean over all segments of all lengths, and their count; `None` without a
    /// segment.
    pub fn mean(&self) -> Option<([f64; N], usize)> {
        let count: usize = self.counts.iter().sum();
        let total = |value: usize| self.sums.iter().map(|s| s[value]).sum::<f64>();
        let mean = |value| total(value) / count as f64;
        (count > 0).then(|| (std::array::from_fn(mean), count))
    }

    /// Returns length (m), mean and count for each length that has segments.
    pub fn means(&self) -> impl Iterator<Item = (f64, [f64; N], usize)> + '_ {
        let lengths = SEGMENT_LENGTHS_M.iter().zip(&self.sums).zip(&self.counts);
        lengths
            .filter(|(_, count)| **count > 0)
            .map(|((&length_m, sums), &count)| {
                (length_m, sums.map(|sum| sum / count as f64), count)
            })
    }
}
