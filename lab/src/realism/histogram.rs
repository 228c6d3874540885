//! Histograms of powers, overall and range by range.

use gyre_radar::PolarScan;
use serde::Serialize;

/// The number of times that each power from 0 to 255 occurs.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct Histogram {
    counts: Vec<u64>,
}

impl Default for Histogram {
    fn default() -> Self {
        Self {
            counts: vec![0; 256],
        }
    }
}

impl Histogram {
    /// Counts powers.
    pub fn add<'p>(&mut self, powers: impl IntoIterator<Item = &'p u8>) {
        for power in powers {
            self.counts[usize::from(*power)] += 1;
        }
    }

    /// Returns the number of powers counted.
    pub fn total(&self) -> u64 {
        self.counts.iter().sum()
    }

    /// Returns the mean power; NaN of nothing.
    pub fn mean(&self) -> f64 {
        let products = self
            .counts
            .iter()
            .zip(0..)
            .map(|(count, power)| count * power);
        products.sum::<u64>() as f64 / self.total() as f64
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

    /// Returns the share of the powers above `threshold`; NaN of nothing.
    pub fn share_above(&self, threshold: u8) -> f64 {
        let above: u64 = self.counts[usize::from(threshold) + 1..].iter().sum();
        above as f64 / self.total() as f64
    }

    /// Returns the powers that occur, in order.
    pub fn levels(&self) -> impl DoubleEndedIterator<Item = u8> {
        (0..=u8::MAX).filter(|power| self.counts[usize::from(*power)] > 0)
    }

    /// Returns the first Wasserstein distance, counts: how far the powers of one must be moved, on average, to become those of the
    /// other.
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

/// A histogram for each cell of range, over all azimuths and scans.
#[derive(Clone, Debug)]
pub struct PowerByRange {
    cells: Vec<Histogram>,
}

impl PowerByRange {
    /// Creates empty histograms for scans of `cells` cells.
    pub fn new(cells: usize) -> Self {
        Self {
            cells: vec![Histogram::default(); cells],
        }
    }

    /// Counts a scan's powers. It has the grid's cells.
    pub fn add(&mut self, scan: &PolarScan<'_>) {
        for azimuth in 0..scan.geometry.azimuths {
            for (power, cell) in scan.row(azimuth).iter().zip(&mut self.cells) {
                cell.counts[usize::from(*power)] += 1;
            }
        }
    }

    /// Returns the histogram over all ranges.
    pub fn histogram(&self) -> Histogram {
        let mut all = Histogram::default();
        for cell in &self.cells {
            all.counts
                .iter_mut()
                .zip(&cell.counts)
                .for_each(|(sum, count)| *sum += count);
        }
        all
    }

    /// Returns the mean power of each cell.
    pub fn means(&self) -> Vec<f64> {
        self.cells.iter().map(Histogram::mean).collect()
    }

    /// Returns the power of each cell that this share of its powers does not exceed.
    pub fn percentiles(&self, share: f64) -> Vec<u8> {
        self.cells
            .iter()
            .map(|cell| cell.percentile(share))
            .collect()
    }
}
