//! Extraction of sparse points from a polar scan: its strongest returns, at their measured
//! positions.
//!
//! A point is a range cell above the floor that survives non-maximum suppression across the
//! azimuths within the antenna's beam: a scatterer appears in several azimuths, and the strongest
//! gives its bearing. There is no suppression along range, so that a wall at a grazing angle is
//! kept as a whole.

mod peaks;
mod range_cells;

#[cfg(test)]
mod tests;

use gyre_geometry::{
    SettingError, SparsePoint, check, check_bounds,
    scan::{PolarScan, ScanError, Sense},
};
use peaks::{Beam, Peak};
use range_cells::RangeCells;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The weight of a point is 1 from this power above the floor on.
pub const WEIGHT_CAP: f32 = 60.0;
/// The largest [`PointsConfig::capacity`].
pub const MAX_POINTS: usize = 65_536;

/// Selection of points: the section `[points]` of a configuration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PointsConfig {
    /// Half width of the non-maximum suppression, degrees, rounded to whole azimuths: a point is
    /// the strongest return at its range within it. Default 2.7: three azimuths of 0.9.
    pub beam_deg: f32,
    /// Approximate depth of a range cell, m, rounded to whole bins. Default 0.17.
    pub range_cell_m: f32,
    /// Minimum range, m. Nearer returns are reflections of the vehicle itself. Default 5.
    pub min_range_m: f32,
    /// Maximum range, m. Farther away the beam is metres wide, and bearings are inaccurate.
    /// Default 80.
    pub max_range_m: f32,
    /// Maximum number of points per scan; the weakest are dropped. 0 disables the extraction.
    /// Default 8192.
    pub capacity: usize,
}

impl Default for PointsConfig {
    fn default() -> Self {
        Self {
            beam_deg: 2.7,
            range_cell_m: 0.17,
            min_range_m: 5.0,
            max_range_m: 80.0,
            capacity: 8192,
        }
    }
}

impl PointsConfig {
    pub fn validate(&self) -> Result<(), SettingError> {
        check_bounds! { self, "points":
            beam_deg in ([0.0, 45.0], "0 to 45"),
            range_cell_m in ([1e-3, 10.0], "0.001 to 10"),
            min_range_m in ([0.0, 1e4], "0 to 10000"),
        }
        let above_min_m = f64::from(self.min_range_m).next_up();
        let bounds = ([above_min_m, 1e4], "more than min_range_m, at most 10000");
        check("points", "max_range_m", self.max_range_m.into(), bounds)?;
        let bounds = ([0.0, MAX_POINTS as f64], "at most 65536");
        check("points", "capacity", self.capacity as f64, bounds)
    }
}

#[derive(Debug)]
pub struct PointExtractor {
    config: PointsConfig,
    cells: RangeCells,
    beam: Beam,
    /// Histogram of the powers of the peaks, to drop the weakest.
    counts: Vec<u32>,
}

impl PointExtractor {
    pub fn new(config: &PointsConfig) -> Result<Self, SettingError> {
        config.validate()?;
        Ok(Self {
            config: config.clone(),
            cells: RangeCells::default(),
            beam: Beam::new(config.beam_deg.to_radians()),
            counts: Vec::with_capacity(range_cells::MAX_POWER + 1),
        })
    }

    /// Writes the points of `scan` with a power above `floor` to the start of `out`, ordered by
    /// azimuth, then by range. A point's weight is its power above the floor over
    /// [`WEIGHT_CAP`], at most 1. Returns the number of points, at most
    /// [`PointsConfig::capacity`] and `out.len()`. Azimuths that were not measured give no points
    /// and suppress none.
    /// On an error `out` is unchanged.
    pub fn extract(
        &mut self,
        scan: &PolarScan<'_>,
        floor: u8,
        out: &mut [SparsePoint],
    ) -> Result<usize, ScanError> {
        scan.check()?;
        let room = out.len().min(self.config.capacity);
        if room == 0 {
            return Ok(0);
        }
        self.cells.update(scan, floor, &self.config);
        let peaks = self.beam.peaks(scan, &self.cells);
        let weakest = weakest_that_fits(peaks, room, &mut self.counts);
        let cap = WEIGHT_CAP * self.cells.layout.bins_per_cell as f32;
        let mut count = 0;
        for peaks in peaks.chunk_by(|a, b| a.azimuth == b.azimuth) {
            let view = View::of(scan, usize::from(peaks[0].azimuth));
            for peak in peaks.iter().filter(|peak| peak.power >= weakest) {
                out[count] = view.point(
                    self.cells.centre_m(peak.cell),
                    (f32::from(peak.power) / cap).min(1.0),
                );
                count += 1;
            }
        }
        Ok(count)
    }
}

fn weakest_that_fits(peaks: &[Peak], room: usize, counts: &mut Vec<u32>) -> i16 {
    if peaks.len() <= room {
        return 1;
    }
    counts.clear();
    counts.resize(range_cells::MAX_POWER + 1, 0);
    for peak in peaks {
        counts[peak.power as usize] += 1;
    }
    let mut left = room as u32;
    let mut weakest = range_cells::MAX_POWER;
    while weakest > 0 && counts[weakest] <= left {
        left -= counts[weakest];
        weakest -= 1;
    }
    weakest as i16 + 1
}

struct View {
    /// Unit vector of the azimuth, x forward and y left.
    direction: [f32; 2],
    time_s: f32,
    doppler_s: f32,
}

impl View {
    fn of(scan: &PolarScan<'_>, azimuth: usize) -> Self {
        let (sin, cos) = scan.azimuth_rad[azimuth].sin_cos();
        let left = match scan.geometry.sense {
            Sense::Clockwise => -sin,
            Sense::CounterClockwise => sin,
        };
        Self {
            direction: [cos, left],
            time_s: scan.time_s(azimuth) as f32,
            doppler_s: scan.doppler_s(azimuth),
        }
    }

    fn point(&self, range_m: f32, weight: f32) -> SparsePoint {
        SparsePoint {
            x_m: range_m * self.direction[0],
            y_m: range_m * self.direction[1],
            time_s: self.time_s,
            weight,
            doppler_s: self.doppler_s,
        }
    }
}
