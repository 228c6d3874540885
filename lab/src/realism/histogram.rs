//! How often each power occurs.

use serde::Serialize;

/// The powers of an 8-bit scan.
pub const LEVELS: usize = 256;

/// How often each power from 0 to 255 occurs.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct Histogram {
    counts: Vec<u64>,
}

impl Default for Histogram {
    fn default() -> Self {
        Self {
            counts: vec![0; LEVELS],
        }
    }
}

impl Histogram {
    /// Counts powers.
    pub fn add(&mut self, powers: &[u8]) {
        for power in powers {
            self.counts[usize::from(*power)] += 1;
        }
    }

    /// Adds counts, by power.
    pub(crate) fn add_counts(&mut self, counts: &[u64]) {
        for (sum, count) in self.counts.iter_mut().zip(counts) {
            *sum += count;
        }
    }

    /// How often each power occurs: 256 numbers.
    pub fn counts(&self) -> &[u64] {
        &self.counts
    }

    /// All that was counted.
    pub fn total(&self) -> u64 {
        self.counts.iter().sum()
    }

    /// The least power that at least this share of all does not exceed; 0 of nothing.
    pub fn percentile(&self, share: f64) -> u8 {
        percentile(&self.counts, share)
    }

    /// Share of the powers above `threshold`; NaN of nothing.
    pub fn share_above(&self, threshold: u8) -> f64 {
        let above: u64 = self.counts[usize::from(threshold) + 1..].iter().sum();
        above as f64 / self.total() as f64
    }

    /// Powers that occur, in order.
    pub fn levels(&self) -> impl DoubleEndedIterator<Item = u8> {
        (0..=u8::MAX).filter(|power| self.counts[usize::from(*power)] > 0)
    }

    /// Wasserstein's first distance, counts: how far the powers of one must be moved, on average, to become those of the other.
    pub fn wasserstein(&self, other: &Self) -> f64 {
        let (total, other_total) = (self.total() as f64, other.total() as f64);
        let (mut below, mut other_below) = (0, 0);
        let mut distance = 0.0;
        for (count, other_count) in self.counts.iter().zip(&other.counts) {
            below += count;
            other_below += other_count;
            distance += (below as f64 / total - other_below as f64 / other_total).abs();
        }
        distance
    }
}

/// Mean of the powers counted.
pub(crate) fn mean(counts: &[u64]) -> f64 {
    let sum: u64 = counts
        .iter()
        .zip(0..)
        .map(|(count, power)| count * power)
        .sum();
    sum as f64 / counts.iter().sum::<u64>() as f64
}

/// See [`Histogram::percentile`].
pub(crate) fn percentile(counts: &[u64], share: f64) -> u8 {
    let wanted = share * counts.iter().sum::<u64>() as f64;
    let mut below = 0;
    let found = counts.iter().position(|count| {
        below += count;
        below as f64 >= wanted && below > 0
    });
    found.unwrap_or(0) as u8
}
