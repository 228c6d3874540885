//! Statistics of the scans of a recording.

use gyre_masking::MaskingConfig;
use gyre_radar::RasterError;
use serde_json::json;

use super::{
    change::change,
    correlation::{in_azimuth, in_range, lag_at_half, mean_power},
    grid::RangeGrid,
    histogram::Histogram,
    sample::Sample,
};
use crate::report::{Record, record};

/// A bin counts as saturated if its power is less than so many counts below the highest that the
/// recording has. A receiver at its limit piles powers up there; where the limit lies is the
/// sensor's own, and no recording known reaches 255.
const SATURATED_LEVELS: u8 = 4;
/// Half of the range over which the power at a range is averaged, m: single cells are noisy.
const AROUND_M: f64 = 0.5;

/// Statistics of the scans of a recording.
#[derive(Clone, Debug)]
pub struct Statistics {
    /// The histogram of all powers on the grid.
    pub histogram: Histogram,
    /// Mean power, cell by cell of range.
    pub mean_power: Vec<f64>,
    /// All that is one number.
    pub figures: Record,
}

impl Statistics {
    /// Measures scans. `raw` is the histogram of the sensor's own bins.
    ///
    /// # Errors
    /// A grid that cannot be drawn as a raster.
    pub fn of(samples: &[Sample], raw: &Histogram, grid: RangeGrid) -> Result<Self, RasterError> {
        let threshold = MaskingConfig::default().threshold;
        let mut histogram = Histogram::default();
        samples
            .iter()
            .for_each(|sample| histogram.add(&sample.scan.view()));
        let mean_power = mean_power(samples, grid);
        let around = |range_m: f64| {
            let near = grid.cell_at((range_m - AROUND_M).max(0.0))?;
            let cells = &mean_power[near..=grid.cell_at(range_m + AROUND_M)?];
            Some(cells.iter().sum::<f64>() / cells.len() as f64)
        };
        let saturated_share = match raw.highest() {
            Some(top) if top >= SATURATED_LEVELS => raw.share_above(top - SATURATED_LEVELS),
            _ => 0.0,
        };
        let range_lag = lag_at_half(&in_range(samples, &mean_power, grid));
        let azimuth_lag = lag_at_half(&in_azimuth(samples, &mean_power));
        let azimuths = samples
            .first()
            .map_or(0, |sample| sample.scan.geometry.azimuths);
        let change = change(samples, grid.range_m(), threshold)?;
        let figures = record(json!({
            "scans": samples.len(),
            "pairs": change.map_or(0, |change| change.pairs),
            "power_at_10_m": around(10.0),
            "range_correlation_m": range_lag.map(|lag| lag * f64::from(grid.resolution_m)),
            "azimuth_correlation_deg": azimuth_lag.map(|lag| lag * (360.0 / azimuths as f64)),
            "saturated_share": saturated_share,
            "share_above": histogram.share_above(threshold),
            "next_correlation": change.map(|change| change.correlation),
            "next_unmatched_share": change.map(|change| change.unmatched_share),
        }));
        Ok(Self {
            histogram,
            mean_power,
            figures,
        })
    }

    /// Returns a figure by its key, if it is known.
    pub fn figure(&self, key: &str) -> Option<f64> {
        self.figures.get(key)?.as_f64()
    }
}
