//! Histograms of powers.

use gyre_radar::PolarScan;

/// The number of times that each power from 0 to 255 occurs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Histogram {
    counts: [u64; 256],
}

impl Default for Histogram {
    fn default() -> Self {
        Self { counts: [0; 256] }
    }
}

impl Histogram {
    /// Counts the powers of a scan.
    pub fn add(&mut self, scan: &PolarScan<'_>) {
        for power in scan.power() {
            self.counts[usize::from(*power)] += 1;
        }
    }

    /// Returns the number of powers counted.
    pub fn total(&self) -> u64 {
        self.counts.iter().sum()
    }

    /// Returns the least power that at least this share of all does not exceed; 0 of nothing.
    pub fn percentile(&self, share: f64) -> u8 {
        let wanted = share * self.total() as f64;
        let mut below = 0;
        let found = self.counts.iter().position(|count| {
            below += count;
            below as f64 >= wanted && below > 0
        });
        found.unwrap_or(0) as u8
    }

    /// Returns the highest power that occurs.
    pub fn highest(&self) -> Option<u8> {
        self.counts
            .iter()
            .rposition(|count| *count > 0)
            .map(|power| power as u8)
    }

    /// Returns the share of the powers above `threshold`; NaN of nothing.
    pub fn share_above(&self, threshold: u8) -> f64 {
        let above: u64 = self.counts[usize::from(threshold) + 1..].iter().sum();
        above as f64 / self.total() as f64
    }

    /// Returns the first Wasserstein distance, counts: how far the powers of one must be moved, on
    /// average, to become those of the other.
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
