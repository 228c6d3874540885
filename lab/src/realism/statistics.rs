//! What a recording is like.

use serde::Serialize;

use crate::realism::{Change, Curve, Histogram, RangeGrid, Streaks};

/// A recording as a whole, and its halves: how far apart these are is what a distance owes to chance and to the streets driven.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Measured {
    /// All of it.
    pub whole: Recording,
    /// Its first and its second half; `None` where it has too few scans.
    #[serde(skip)]
    pub halves: Option<[Recording; 2]>,
}

/// All that was measured of a recording, or of a half.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Recording {
    /// What it is called.
    pub name: String,
    /// Of its scans.
    pub statistics: ScanStatistics,
    /// The plain search: the paper's form. `None` without ground truth or without a second scan.
    pub plain: Option<SearchErrors>,
    /// The refined search: the shipped configuration.
    pub refined: Option<SearchErrors>,
}

/// How far an odometry is off on the recording.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SearchErrors {
    /// Motions from scan to scan that were judged.
    pub motions: usize,
    /// Length of the truth, m.
    pub path_m: f64,
    /// Root of the mean squared translation error of a motion, m.
    pub translation_rmse_m: f64,
    /// Root of the mean squared rotation error of a motion, degrees.
    pub rotation_rmse_deg: f64,
    /// Absolute trajectory error, m.
    pub ate_m: f64,
    /// Segment error, %; `None` where the path is shorter than 100 m.
    pub seg_percent: Option<f64>,
}

/// ScanStatistics of the scans of a recording.
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
    /// Share of the sensor's own bins within [`crate::meter::SATURATED_LEVELS`] of the highest power that occurs.
    pub saturated_share: f64,
    /// The grid on which all below was measured.
    pub grid: RangeGrid,
    /// How often each power occurs.
    pub histogram: Histogram,
    /// Power above which something is there.
    pub threshold: u8,
    /// Share of the cells above it.
    pub share_above: f64,
    /// Mean power, cell by cell of range.
    pub mean_power: Vec<f64>,
    /// The power that 10 % of those at a range do not exceed: the floor.
    pub floor: Vec<u8>,
    /// The power that half of those at a range do not exceed.
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
    /// Mean power at a range, over half a metre either way: single cells are noisy. `None` beyond the grid.
    pub fn mean_power_at(&self, range_m: f64) -> Option<f64> {
        self.around(range_m, |cell| self.mean_power[cell])
    }

    /// Mean of a cell's figure over half a metre either way of a range; `None` beyond the grid.
    pub fn around(&self, range_m: f64, figure: impl Fn(usize) -> f64) -> Option<f64> {
        const HALF_M: f64 = 0.5;
        let (near, far) = (
            self.grid.cell_at((range_m - HALF_M).max(0.0))?,
            self.grid.cell_at(range_m + HALF_M)?,
        );
        Some((near..=far).map(figure).sum::<f64>() / (far - near + 1) as f64)
    }
}
