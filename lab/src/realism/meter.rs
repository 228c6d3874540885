//! Measures a recording, scan by scan.

use gyre_radar::{PolarScan, RasterError, ScanError};
use nalgebra::Isometry2;
use thiserror::Error;

use crate::realism::{
    ChangeMeter, Histogram, PowerByRange, RangeGrid, Resampler, ScanStatistics,
    correlation::Products, streaks::StreakCounter,
};

/// A bin counts as saturated if its power is less than so many counts below the highest that the recording has. A receiver at its
/// limit piles powers up there; where the limit lies is the sensor's own, and no recording known reaches 255.
pub const SATURATED_LEVELS: u8 = 4;

/// What to measure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeterConfig {
    /// On which grid.
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
    sensor: Option<Sensor>,
    /// Of the sensor's own bins.
    raw: Histogram,
    powers: PowerByRange,
    products: Products,
    streaks: StreakCounter,
    change: ChangeMeter,
}

/// What the first scan says of the sensor.
#[derive(Clone, Copy, Debug)]
struct Sensor {
    azimuths: usize,
    resolution_m: f32,
    bins: usize,
}

impl Meter {
    /// Sets memory aside.
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
    /// and the motion is known.
    ///
    /// A motion that no sensor makes is a wrong one: the scan is then not compared.
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
        self.sensor.get_or_insert(Sensor {
            azimuths: own.azimuths,
            resolution_m: own.range_resolution_m,
            bins: own.bins,
        });
        for azimuth in 0..own.azimuths {
            self.raw.add(scan.row(azimuth));
        }
        let scan = self.now.scan();
        self.powers.add(&scan);
        self.products.add(&scan);
        self.streaks.add(&scan);
        self.scans += 1;
        match motion {
            Some(motion) if self.scans > 1 => {
                match self.change.add(&self.before.scan(), &scan, motion) {
                    Err(RasterError::Twist { .. }) => Ok(()),
                    compared => Ok(compared?),
                }
            }
            _ => Ok(()),
        }
    }

    /// What was measured; `None` without a scan that has azimuths.
    pub fn finish(self) -> Option<ScanStatistics> {
        let sensor = self.sensor.filter(|sensor| sensor.azimuths > 0)?;
        let (grid, threshold) = (self.config.grid, self.config.threshold);
        let (histogram, mean_power) = (self.powers.histogram(), self.powers.means());
        Some(ScanStatistics {
            scans: self.scans,
            azimuths: sensor.azimuths,
            sensor_resolution_m: sensor.resolution_m,
            sensor_bins: sensor.bins,
            levels: self.raw.levels().collect(),
            saturated_share: saturated_share(&self.raw),
            grid,
            threshold,
            share_above: histogram.share_above(threshold),
            histogram,
            floor: self.powers.percentiles(0.1),
            median_power: self.powers.percentiles(0.5),
            high_power: self.powers.percentiles(0.99),
            range_correlation: self
                .products
                .in_range(&mean_power, grid.resolution_m.into()),
            azimuth_correlation: self.products.in_azimuth(&mean_power),
            mean_power,
            streaks: self.streaks.finish(),
            change: self.change.finish(),
        })
    }
}

fn saturated_share(raw: &Histogram) -> f64 {
    match raw
        .levels()
        .next_back()
        .and_then(|highest| highest.checked_sub(SATURATED_LEVELS))
    {
        Some(below) => raw.share_above(below),
        None => 0.0,
    }
}
