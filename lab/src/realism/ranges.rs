//! How strong the powers are at each range.

use gyre_radar::PolarScan;

use crate::realism::histogram::{Histogram, LEVELS, mean, percentile};

/// A histogram for each cell of range, over all azimuths and scans.
#[derive(Clone, Debug)]
pub struct PowerByRange {
    /// `cells x 256`.
    counts: Vec<u64>,
}

impl PowerByRange {
    /// Nothing yet, for scans of so many cells.
    pub fn new(cells: usize) -> Self {
        Self {
            counts: vec![0; cells * LEVELS],
        }
    }

    /// Counts a scan's powers. It has the grid's cells.
    pub fn add(&mut self, scan: &PolarScan<'_>) {
        for azimuth in 0..scan.geometry.azimuths {
            for (power, counts) in scan
                .row(azimuth)
                .iter()
                .zip(self.counts.chunks_exact_mut(LEVELS))
            {
                counts[usize::from(*power)] += 1;
            }
        }
    }

    /// Over all ranges.
    pub fn histogram(&self) -> Histogram {
        let mut histogram = Histogram::default();
        self.cells().for_each(|counts| histogram.add_counts(counts));
        histogram
    }

    /// Mean power in each cell.
    pub fn means(&self) -> Vec<f64> {
        self.cells().map(mean).collect()
    }

    /// The power in each cell that this share of its powers does not exceed.
    pub fn percentiles(&self, share: f64) -> Vec<u8> {
        self.cells()
            .map(|counts| percentile(counts, share))
            .collect()
    }

    fn cells(&self) -> impl Iterator<Item = &[u64]> {
        self.counts.chunks_exact(LEVELS)
    }
}
