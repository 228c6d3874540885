//! Conversion of a polar scan to a Cartesian raster, by the measured azimuths, with optional motion
//! compensation.
//!
//! A raster is `n x n`, row-major: row 0 is far ahead, column 0 far left, and the sensor is at the
//! centre of the middle cell (between the middle cells where `n` is even). Its frame is the
//! sensor's at the scan's stamp, x forward and y left. A value is the power above a floor.

mod bearing_table;
mod cells;
pub(crate) mod kernels;
mod polar_image;
mod sweep_motion;

#[cfg(test)]
pub(crate) mod tests;

use std::fmt;

use bearing_table::BearingTable;
use cells::Cells;
use gyre_geometry::{
    SettingError, Twist, check, check_bounds,
    scan::{PolarScan, ScanError, Sense, SweepGeometry},
};
use kernels::locate::{self, Lookup, Taps};
use ndarray::ArrayViewMut2;
use polar_image::PolarImage;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sweep_motion::SweepMotion;
pub use sweep_motion::{MAX_TRAVEL_M, MAX_TURN_RAD};

pub const MAX_CELLS_PER_SIDE: usize = 4096;

/// The rule that computes the value of a cell from the range bins.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Sampling {
    /// The mean of the range bins that one cell covers, linear between azimuths: no aliasing where
    /// bins are finer than cells. Bins are summed in groups of 2, 4, ... up to an eighth of that
    /// depth, which may shift a single bright bin by a sixteenth of a cell. Azimuths are not
    /// averaged: near the sensor, where several fall into one cell, averaging improved no
    /// trajectory.
    #[default]
    Averaged,
    /// Bilinear between the four nearest measurements: samples one point of the scan per cell.
    Bilinear,
}

impl fmt::Display for Sampling {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

/// Size and sampling of the rasters: the section `[raster]` of a configuration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RasterConfig {
    /// Cells per side. With an odd number the sensor is at the centre of a cell.
    pub n: usize,
    /// Size of a cell, m.
    pub cell_m: f32,
    /// Minimum range, m. Nearer cells, which hold the vehicle or the ringing of the sensor, are set
    /// to zero.
    pub min_range_m: f32,
    /// The rule that computes the value of a cell from the range bins: `averaged` or `bilinear`.
    pub sampling: Sampling,
}

impl Default for RasterConfig {
    fn default() -> Self {
        Self {
            n: 255,
            cell_m: 0.8,
            min_range_m: 2.0,
            sampling: Sampling::Averaged,
        }
    }
}

impl RasterConfig {
    /// So many cells of this size per side, otherwise as by default.
    pub fn of(n: usize, cell_m: f32) -> Self {
        Self {
            n,
            cell_m,
            ..Self::default()
        }
    }

    pub fn validate(&self) -> Result<(), SettingError> {
        let cells = ([1.0, MAX_CELLS_PER_SIDE as f64], "1 to 4096");
        check("raster", "n", self.n as f64, cells)?;
        check_bounds! { self, "raster":
            cell_m in ([1e-3, 100.0], "0.001 to 100"),
            min_range_m in ([0.0, f64::MAX], "0 or more"),
        }
        Ok(())
    }
}

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RasterError {
    #[error(transparent)]
    Setting(#[from] SettingError),
    #[error("the raster needs a contiguous array of {n} x {n} cells, but got {} x {}", actual[0], actual[1])]
    Shape { n: usize, actual: [usize; 2] },
    #[error(transparent)]
    Scan(#[from] ScanError),
    /// The motion to compensate is not finite, or exceeds [`MAX_TURN_RAD`] or [`MAX_TRAVEL_M`].
    #[error(
        "a turn of {turn_rad} rad and a travel of {travel_m} m within half a sweep are out of bounds (twist {twist:?})"
    )]
    Twist {
        twist: Twist,
        /// The turn between the scan's stamp and the azimuth furthest from it in time, rad.
        turn_rad: f64,
        /// The distance travelled in that time, m.
        travel_m: f64,
    },
}

/// Converts scans to rasters. [`Rasteriser::new`] allocates the memory that depends on the raster,
/// and the first scan of a size the memory that depends on the scan.
#[derive(Debug)]
pub struct Rasteriser {
    config: RasterConfig,
    cells: Cells,
    bearings: BearingTable,
    polar: PolarImage,
    taps: Vec<Taps>,
}

impl Rasteriser {
    pub fn new(config: &RasterConfig) -> Result<Self, RasterError> {
        config.validate()?;
        let window_m = match config.sampling {
            Sampling::Averaged => config.cell_m,
            Sampling::Bilinear => 0.0,
        };
        let cells = Cells::new(config.n, config.cell_m, Sense::Clockwise);
        Ok(Self {
            config: config.clone(),
            bearings: BearingTable::new(),
            polar: PolarImage::new(window_m),
            taps: vec![Taps::NONE; cells.blocks()],
            cells,
        })
    }

    /// Writes the raster of `scan`: `n x n` powers above `floor`, from 0 to `255 - floor`.
    ///
    /// With a `twist` the raster is motion-compensated: it shows the scene as seen from the
    /// sensor's pose at `scan.geometry.stamp_ns`, by the stamps of the azimuths. The Doppler shift
    /// of the ranges is compensated where the scan's Doppler coefficient is known. Cells that no
    /// azimuth or bin covers are zero; a scan without azimuths or bins gives zeros. Powers are
    /// interpolated between neighbouring azimuths, also between the last and the first.
    /// On an error `raster` is unchanged.
    pub fn rasterise(
        &mut self,
        scan: &PolarScan<'_>,
        floor: u8,
        twist: Option<Twist>,
        mut raster: ArrayViewMut2<'_, f32>,
    ) -> Result<(), RasterError> {
        let cells = self.cells_of(&mut raster)?;
        scan.check()?;
        if scan.geometry.azimuths == 0 || scan.geometry.bins == 0 {
            cells.fill(0.0);
            return Ok(());
        }
        let motion = twist
            .map(|twist| SweepMotion::new(twist, scan))
            .transpose()?;
        self.bearings.update(scan);
        self.cells.set_sense(scan.geometry.sense);
        let travel_m = motion.as_ref().map_or(0.0, |motion| motion.travel_m);
        self.polar.fill(
            scan,
            floor,
            self.cells.max_range_m + travel_m,
            motion.as_ref(),
        );
        self.sample(&scan.geometry, motion.as_ref(), cells);
        Ok(())
    }

    fn sample(&mut self, geometry: &SweepGeometry, motion: Option<&SweepMotion>, out: &mut [f32]) {
        let stride = self.polar.stride();
        let lookup = Lookup {
            bearings: &self.bearings,
            last_azimuth: geometry.azimuths as i32 - 1,
            stride: stride as i32,
            columns_per_metre: self.polar.columns_per_metre(),
            column_at_sensor: self.polar.column_at_sensor(geometry.range_offset_m),
            last_column: (stride - 2) as f32,
            min_range_m: self.config.min_range_m,
        };
        for (index, row) in out.chunks_exact_mut(self.config.n).enumerate() {
            let cells = self.cells.row(index);
            match motion {
                None => locate::locate(&cells, &lookup, &mut self.taps),
                Some(motion) => locate::locate_moving(&cells, motion, &lookup, &mut self.taps),
            }
            locate::blend(&self.taps, &self.polar.samples, stride, row);
        }
    }

    fn cells_of<'a>(
        &self,
        raster: &'a mut ArrayViewMut2<'_, f32>,
    ) -> Result<&'a mut [f32], RasterError> {
        let (n, actual) = (self.config.n, raster.dim().into());
        match actual == [n, n] {
            true => raster.as_slice_mut(),
            false => None,
        }
        .ok_or(RasterError::Shape { n, actual })
    }
}
