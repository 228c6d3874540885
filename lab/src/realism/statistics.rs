//! Statistics of the scans of a recording, measured scan by scan.

use gyre_radar::{PolarScan, RasterError, ScanError};
use nalgebra::Isometry2;
use serde::Serialize;
use thiserror::Error;

use super::{
    change::{Change, ChangeMeter},
    correlation::{Curve, Products},
    grid::{RangeGrid, Resampler},
    histogram::{Histogram, PowerByRange},
    streaks::{StreakCounter, Streaks},
};

/// A bin counts as saturated if its power is less than so many counts below the highest that the recording has. A receiver at its
/// limit piles powers up there; where the limit lies is the sensor's own, and no recording known reaches 255.
const SATURATED_LEVELS: u8 = 4;

/// Statistics of the scans of a recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ScanStatistics {
    /// Scans that were measured.
    pub scans: usize,
    /// Azimuths of the first of them.
    pub azimuths: usize,
    /// The sensor's own resolution, m.
    pub sensor_resolution_m: f32,
    /// The sensor's own bins.
    pub sensor_bins: usize,
    /// Powers that occur in the sensor's own bins, in order.
    pub levels: Vec<u8>,
    /// Share of the sensor's own bins close to the highest power that occurs.
    pub saturated_share: f64,
    /// The grid on which all below was measured.
    pub grid: RangeGrid,
    /// The histogram of all powers.
    pub histogram: Histogram,
    /// Power above which something is there.
    pub threshold: u8,
    /// Share of the cells above it.
    pub share_above: f64,
    /// Mean power, cell by cell of range.
    pub mean_power: Vec<f64>,
    /// The power that 10 % of those at a range do not exceed: the noise floor.
    pub floor: Vec<u8>,
    /// The median power at each range.
    pub median_power: Vec<u8>,
    /// The power that 99 % of those at a range do not exceed: what returns reach.
    pub high_power: Vec<u8>,
    /// Autocorrelation over range, m, of powers less the mean at their range.
    pub range_correlation: Curve,
    /// The same over azimuth, degrees.
    pub azimuth_correlation: Curve,
    /// Azimuths that are bright over their whole length.
    pub streaks: Streaks,
    /// `None`: no two consecutive scans with a known motion between them.
    pub change: Option<Change>,
}

impl ScanStatistics {
    /// Returns the mean of a cell's figure over half a metre either way of a range: single cells are noisy. `None` beyond the grid.
    pub fn around(&self, range_m: f64, figure: impl Fn(usize) -> f64) -> Option<f64> {
        const HALF_M: f64 = 0.5;
        let near = self.grid.cell_at((range_m - HALF_M).max(0.0))?;
        let far = self.grid.cell_at(range_m + HALF_M)?;
        Some((near..=far).map(figure).sum::<f64>() / (far - near + 1) as f64)
    }
}

/// The settings of a measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeterConfig {
    /// The grid of range.
    pub grid: RangeGrid,
    /// Power above which something is there.
    pub threshold: u8,
    /// Cells of the rasters in which consecutive scans are compared, m.
    pub cell_m: f32,
}

/// Why a scan cannot be measured.
#[derive(Debug, Error)]
pub enum MeterError {
    /// It contradicts itself.
    #[error(transparent)]
    Scan(#[from] ScanError),
    /// It cannot be compared with the one before.
    #[error(transparent)]
    Raster(#[from] RasterError),
}

/// Measures a recording, scan by scan.
#[derive(Debug)]
pub struct Meter {
    config: MeterConfig,
    now: Resampler,
    before: Resampler,
    scans: usize,
    /// Azimuths, bins and resolution of the first scan.
    sensor: Option<(usize, usize, f32)>,
    /// The histogram of the sensor's own bins.
    raw: Histogram,
    powers: PowerByRange,
    products: Products,
    streaks: StreakCounter,
    change: ChangeMeter,
}

impl Meter {
    /// Creates a meter that has measured nothing.
    ///
    /// # Errors
    /// Rasters that cannot be made.
    pub fn new(config: MeterConfig) -> Result<Self, RasterError> {
        Ok(Self {
            config,
            now: Resampler::new(config.grid),
            before: Resampler::new(config.grid),
            scans: 0,
            sensor: None,
            raw: Histogram::default(),
            powers: PowerByRange::new(config.grid.cells),
            products: Products::default(),
            streaks: StreakCounter::default(),
            change: ChangeMeter::new(config.grid.range_m(), config.cell_m, config.threshold)?,
        })
    }

    /// Measures a scan. `motion` is its pose in the frame of the scan added before it, if that is the scan before it in the recording
    /// and the motion is known. A motion that no sensor makes is a wrong one: the scan is then not compared.
    ///
    /// # Errors
    /// A scan that contradicts itself; it counts nothing.
    pub fn add(
        &mut self,
        scan: &PolarScan<'_>,
        motion: Option<&Isometry2<f64>>,
    ) -> Result<(), MeterError> {
        self.before.resample(scan)?;
        std::mem::swap(&mut self.now, &mut self.before);
        let own = &scan.geometry;
        self.sensor
            .get_or_insert((own.azimuths, own.bins, own.range_resolution_m));
        (0..own.azimuths).for_each(|azimuth| self.raw.add(scan.row(azimuth)));
        let scan = self.now.scan();
        self.powers.add(&scan);
        self.products.add(&scan);
        self.streaks.add(&scan);
        self.scans += 1;
        let Some(motion) = motion.filter(|_| self.scans > 1) else {
            return Ok(());
        };
        match self.change.add(&self.before.scan(), &scan, motion) {
            Err(RasterError::Twist { .. }) => Ok(()),
            compared => Ok(compared?),
        }
    }

    /// Returns what was measured; `None` without a scan that has azimuths.
    pub fn finish(self) -> Option<ScanStatistics> {
        let (azimuths, sensor_bins, sensor_resolution_m) =
            self.sensor.filter(|(azimuths, ..)| *azimuths > 0)?;
        let (grid, threshold) = (self.config.grid, self.config.threshold);
        let (histogram, mean_power) = (self.powers.histogram(), self.powers.means());
        let levels: Vec<u8> = self.raw.levels().collect();
        let unsaturated = levels
            .last()
            .and_then(|highest| highest.checked_sub(SATURATED_LEVELS));
        let range_correlation = self
            .products
            .in_range(&mean_power, grid.resolution_m.into());
        Some(ScanStatistics {
            scans: self.scans,
            azimuths,
            sensor_resolution_m,
            sensor_bins,
            levels,
            saturated_share: unsaturated.map_or(0.0, |below| self.raw.share_above(below)),
            grid,
            threshold,
            share_above: histogram.share_above(threshold),
            histogram,
            floor: self.powers.percentiles(0.1),
            median_power: self.powers.percentiles(0.5),
            high_power: self.powers.percentiles(0.99),
            range_correlation,
            azimuth_correlation: self.products.in_azimuth(&mean_power),
            mean_power,
            streaks: self.streaks.finish(),
            change: self.change.finish(),
        })
    }
}
