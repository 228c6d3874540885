//! The difference between a scan and the next, seen from the same place.

use gyre_geometry::Twist;
use gyre_radar::{PolarScan, RasterConfig, RasterError, Rasteriser, Sampling};
use nalgebra::Isometry2;
use ndarray::{Array2, s};
use serde::Serialize;

/// The difference between consecutive scans.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Change {
    /// Pairs of scans that were compared.
    pub pairs: usize,
    /// Correlation coefficient of the powers above the threshold, the mean over the pairs.
    pub correlation: f64,
    /// Share of the cells with a return that have none within one cell in the other scan, both ways.
    pub unmatched_share: f64,
}

/// Compares pairs of scans.
#[derive(Debug)]
pub struct ChangeMeter {
    rasteriser: Rasteriser,
    earlier: Array2<f32>,
    later: Array2<f32>,
    threshold: u8,
    pairs: usize,
    correlations: f64,
    returns: u64,
    unmatched: u64,
}

impl ChangeMeter {
    /// For rasters that reach to `range_m`, with cells of `cell_m`. What is not above `threshold` is no return.
    ///
    /// # Errors
    /// A raster that cannot be made: more than 4096 cells a side, cells of impossible size.
    pub fn new(range_m: f64, cell_m: f32, threshold: u8) -> Result<Self, RasterError> {
        let half = (range_m / f64::from(cell_m)) as usize;
        let n = 2 * half + 1;
        let config = RasterConfig {
            n,
            cell_m,
            sampling: Sampling::Averaged,
            ..RasterConfig::default()
        };
        let rasteriser = Rasteriser::new(&config)?;
        let raster = Array2::zeros((n, n));
        Ok(Self {
            rasteriser,
            earlier: raster.clone(),
            later: raster,
            threshold,
            pairs: 0,
            correlations: 0.0,
            returns: 0,
            unmatched: 0,
        })
    }

    /// Compares a scan with a later one, `motion` being the later one's pose in the earlier one's frame.
    ///
    /// Both are drawn as seen from where the sensor was half-way between, by one motion at constant velocity through both sweeps:
    /// so the sweeps' distortion is undone and the scans are aligned in one step, and both are blurred alike.
    ///
    /// # Errors
    /// A scan that contradicts itself, a motion that no sensor makes.
    pub fn add(
        &mut self,
        earlier: &PolarScan<'_>,
        later: &PolarScan<'_>,
        motion: &Isometry2<f64>,
    ) -> Result<(), RasterError> {
        let interval_ns = later
            .geometry
            .stamp_ns
            .saturating_sub(earlier.geometry.stamp_ns);
        let twist = Twist::from_motion(motion, interval_ns as f64 * 1e-9);
        let between_ns = earlier.geometry.stamp_ns + interval_ns / 2;
        for (scan, raster) in [(earlier, &mut self.earlier), (later, &mut self.later)] {
            let mut scan = *scan;
            scan.geometry.stamp_ns = between_ns;
            let raster = raster.view_mut();
            self.rasteriser
                .rasterise(&scan, self.threshold, Some(twist), raster)?;
        }
        if let Some(correlation) = correlation(&self.earlier, &self.later) {
            self.pairs += 1;
            self.correlations += correlation;
        }
        for (these, those) in [(&self.earlier, &self.later), (&self.later, &self.earlier)] {
            let (returns, unmatched) = unmatched(these, those);
            self.returns += returns;
            self.unmatched += unmatched;
        }
        Ok(())
    }

    /// Returns the difference; `None` where nothing could be compared.
    pub fn finish(&self) -> Option<Change> {
        (self.pairs > 0 && self.returns > 0).then(|| Change {
            pairs: self.pairs,
            correlation: self.correlations / self.pairs as f64,
            unmatched_share: self.unmatched as f64 / self.returns as f64,
        })
    }
}

/// Pearson's coefficient over the cells in the raster's circle; `None` where one of them is the same everywhere.
fn correlation(a: &Array2<f32>, b: &Array2<f32>) -> Option<f64> {
    let half = (a.nrows() / 2) as i64;
    let in_circle = |(row, column): (usize, usize)| {
        let (ahead, left) = (row as i64 - half, column as i64 - half);
        ahead * ahead + left * left <= half * half
    };
    let [mut cells, mut sum_a, mut sum_b, mut aa, mut bb, mut ab] = [0.0; 6];
    for ((_, a), b) in a
        .indexed_iter()
        .zip(b)
        .filter(|((place, _), _)| in_circle(*place))
    {
        let (a, b) = (f64::from(*a), f64::from(*b));
        cells += 1.0;
        sum_a += a;
        sum_b += b;
        aa += a * a;
        bb += b * b;
        ab += a * b;
    }
    let covariance = |sum: f64, x: f64, y: f64| sum / cells - x / cells * (y / cells);
    let variances = covariance(aa, sum_a, sum_a) * covariance(bb, sum_b, sum_b);
    (variances > 0.0).then(|| covariance(ab, sum_a, sum_b) / variances.sqrt())
}

/// Returns the number of cells of `these` that have a return, and of those that have none within one cell in `those`.
fn unmatched(these: &Array2<f32>, those: &Array2<f32>) -> (u64, u64) {
    let n = these.nrows();
    let (mut returns, mut unmatched) = (0, 0);
    let within_one = |place: usize| place.saturating_sub(1)..(place + 2).min(n);
    for ((row, column), _) in these.indexed_iter().filter(|(_, power)| **power > 0.0) {
        let near = those.slice(s![within_one(row), within_one(column)]);
        returns += 1;
        unmatched += u64::from(near.iter().all(|power| *power <= 0.0));
    }
    (returns, unmatched)
}
