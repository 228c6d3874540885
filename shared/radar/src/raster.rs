//! Polar scan to Cartesian raster, with the azimuths as measured and, on request, the sweep's motion undone.
//!
//! A raster is `n x n`, row-major: row 0 is far ahead, column 0 far left, and the sensor stands at the centre of
//! the middle cell (between the middle cells where `n` is even). Its frame is the sensor's at the scan's stamp,
//! x forward and y left. A value is the power above a floor.
//!
//! In the order of the work:
//! 1. `bearing_table`: from an angle to the fractional azimuth measured there, and to the time of measuring;
//! 2. `polar_image`: the powers above the floor, averaged along range over what one cell covers, at their true ranges;
//! 3. `kernels::locate`: each cell's place in the polar image, seen from where [`Twist`] puts the sensor, and the
//!    mean of the four samples around it.

mod bearing_table;
mod cells;
mod kernels;
mod polar_image;
mod sweep_motion;

#[cfg(test)]
pub(crate) mod tests;

use crate::scan::{PolarScan, ScanError, Sense, SweepGeometry};
use bearing_table::BearingTable;
use cells::Cells;
use gyre_geometry::Twist;
use kernels::locate::{self, Lookup, Taps};
use ndarray::ArrayViewMut2;
use polar_image::PolarImage;
use serde::{Deserialize, Serialize};
use std::fmt;
use sweep_motion::SweepMotion;
pub use sweep_motion::{MAX_TRAVEL_M, MAX_TURN_RAD};

/// The largest `n` that a raster may have.
pub const MAX_CELLS_A_SIDE: usize = 4096;

/// How a cell's value comes from the range bins.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Sampling {
    /// The mean of the range bins that one cell covers, bilinear between azimuths: no aliasing where bins are finer
    /// than cells. Bins are taken together by 2, 4, ... up to an eighth of that depth, so a single bright bin may move
    /// by a sixteenth of a cell. Azimuths are not averaged: near the sensor, where several fall into one cell, that
    /// made no trajectory better.
    #[default]
    Averaged,
    /// Bilinear between the four nearest measurements: one point of the scan stands for the whole cell.
    Bilinear,
}

impl fmt::Display for Sampling {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Averaged => "averaged",
            Self::Bilinear => "bilinear",
        })
    }
}

/// What raster to make: the section `[raster]` of a configuration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RasterConfig {
    /// Cells a side. Odd numbers put the sensor into the middle of a cell.
    pub n: usize,
    /// Metres a cell.
    pub cell_m: f32,
    /// What is nearer than this is the vehicle or the sensor's ringing, and is blanked. Metres.
    pub min_range_m: f32,
    /// How a cell's value comes from the range bins: `averaged` or `bilinear`.
    pub sampling: Sampling,
    /// What `averaged` takes the mean over: a depth of so many cells. A little more than 1 smooths.
    pub averaged_cells: f32,
}

impl Default for RasterConfig {
    fn default() -> Self {
        Self {
            n: 255,
            cell_m: 0.8,
            min_range_m: 2.0,
            sampling: Sampling::Averaged,
            averaged_cells: 1.0,
        }
    }
}

impl RasterConfig {
    /// Whether a raster can be made so.
    ///
    /// # Errors
    /// [`RasterError::Setting`] names the first key that is out of its bounds.
    pub fn validate(&self) -> Result<(), RasterError> {
        let setting = |key, value, bounds| Err(RasterError::Setting { key, value, bounds });
        if !(1..=MAX_CELLS_A_SIDE).contains(&self.n) {
            return setting("n", self.n as f64, "1 to 4096");
        }
        if !(1e-3..=100.0).contains(&self.cell_m) {
            return setting("cell_m", self.cell_m.into(), "0.001 to 100");
        }
        if !(self.min_range_m >= 0.0 && self.min_range_m.is_finite()) {
            return setting("min_range_m", self.min_range_m.into(), "0 or more");
        }
        if !(0.1..=10.0).contains(&self.averaged_cells) {
            return setting("averaged_cells", self.averaged_cells.into(), "0.1 to 10");
        }
        Ok(())
    }
}

/// Why no raster can be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RasterError {
    /// A setting is out of its bounds.
    #[error("raster.{key} is {value}, but must be {bounds}")]
    Setting {
        /// The setting.
        key: &'static str,
        /// Its value.
        value: f64,
        /// What it may be.
        bounds: &'static str,
    },
    /// The array for the raster is not a contiguous, row-major `n x n`.
    #[error("the raster needs a contiguous array of {n} x {n} cells, but got {} x {}", actual[0], actual[1])]
    Shape {
        /// Cells a side.
        n: usize,
        /// Rows and columns of the array.
        actual: [usize; 2],
    },
    /// The scan contradicts itself.
    #[error(transparent)]
    Scan(#[from] ScanError),
    /// The motion to undo is not finite, or goes further than [`MAX_TURN_RAD`] or [`MAX_TRAVEL_M`].
    #[error(
        "no sensor turns by {turn_rad} rad and travels {travel_m} m within half a sweep (twist {twist:?})"
    )]
    Twist {
        /// The motion.
        twist: Twist,
        /// The turn between the scan's stamp and the azimuth furthest from it in time.
        turn_rad: f64,
        /// The distance travelled in that time.
        travel_m: f64,
    },
}

/// Makes rasters of scans, one after the other. All memory that depends on the raster is set aside by
/// [`Rasteriser::new`], all that depends on the scan's size by the first scan of that size.
#[derive(Debug)]
pub struct Rasteriser {
    config: RasterConfig,
    cells: Cells,
    bearings: BearingTable,
    polar: PolarImage,
    taps: Vec<Taps>,
}

impl Rasteriser {
    /// Sets memory aside and computes where the cells are.
    ///
    /// # Errors
    /// See [`RasterConfig::validate`].
    pub fn new(config: &RasterConfig) -> Result<Self, RasterError> {
        config.validate()?;
        let window_m = match config.sampling {
            Sampling::Averaged => config.cell_m * config.averaged_cells,
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

    /// The configuration that it was made with.
    pub fn config(&self) -> &RasterConfig {
        &self.config
    }

    /// Writes the raster of `scan` to `raster`: `n x n` values, power above `floor`, 0 to `255 - floor`.
    ///
    /// With a `twist` the raster shows the scene from where the sensor stood at `scan.geometry.stamp_ns`: each cell
    /// is looked up where the sensor was when it looked there, by the azimuths' own stamps, and Doppler's shift of the
    /// ranges is undone where the scan knows it.
    /// What no azimuth or bin covers is zero; a scan without azimuths or bins gives zeros. Between the last azimuth
    /// and the first, as between all others, the powers are interpolated.
    ///
    /// # Errors
    /// A wrong shape or layout of `raster`, a scan that contradicts itself, a twist that is not finite or turns too far.
    /// `raster` is unchanged then.
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
        self.bearings.measure(scan);
        self.cells.look_in(scan.geometry.sense);
        let travel_m = motion.as_ref().map_or(0.0, |motion| motion.travel_m);
        self.polar.fill(
            scan,
            floor,
            self.cells.furthest_m + travel_m,
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
            columns_a_metre: self.polar.columns_a_metre(),
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
            locate::blend(&self.taps, self.polar.samples(), stride, row);
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
