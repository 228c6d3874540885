//! The correlation of each row with the mean of its neighbours, over all shifts.

use gyre_simd::simd;
use nalgebra::Vector2;

use super::{
    alternates_at,
    rows::{REACH, Rows, WIDTH},
};
use gyre_geometry::scan::{PolarScan, Sense};

pub(super) const LAGS: usize = 2 * REACH + 1;
/// The mean of this many shifts on either side, about a metre, is subtracted from the correlation.
/// Walls along the beam, at places of their own, correlate broadly; only the scatterers that both
/// chirps see correlate narrowly.
const MEAN_LAGS: usize = 8;
/// The least height of a peak, of at most 1, and the least of one over the highest of its row.
const MIN_HEIGHT: f32 = 0.05;
const MIN_SHARE: f32 = 0.5;

/// The correlations of all rows with echoes that lie between two rows of the other chirp.
#[derive(Debug, Default)]
pub(super) struct Shifts {
    pub rows: Vec<RowShifts>,
    beside: Vec<f32>,
}

#[derive(Clone, Debug)]
pub(super) struct RowShifts {
    pub azimuth: usize,
    /// Unit vector of the bearing, x forward and y left.
    pub direction: Vector2<f64>,
    /// Closing speed that moves the neighbours' echoes one cell farther, m/s; negative for falling
    /// chirps.
    pub mps_per_lag: f64,
    /// Correlation by shift, at most 1, less the mean about it.
    correlation: [f32; WIDTH],
    /// The shift with the highest one, cells, and its height.
    pub top_lag: f64,
    top: f32,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Peak {
    pub lag: f64,
    pub height: f64,
}

impl Shifts {
    pub fn update(&mut self, scan: &PolarScan<'_>, rows: &Rows) {
        self.rows.clear();
        self.rows.reserve(scan.geometry.azimuths);
        for azimuth in (0..scan.geometry.azimuths).filter(|it| alternates_at(scan, *it)) {
            let (before, after) = (rows.padded(azimuth - 1), rows.padded(azimuth + 1));
            self.beside.clear();
            self.beside
                .extend(before.iter().zip(after).map(|(a, b)| a + b));
            let row = rows.row(azimuth);
            let square = |of: &[f32]| of.iter().map(|power| power * power).sum::<f32>();
            let norm = (square(row) * square(&self.beside)).sqrt();
            if norm <= 0.0 {
                continue;
            }
            let mut correlation = [0.0; WIDTH];
            correlate(row, &self.beside, &mut correlation);
            correlation.iter_mut().for_each(|it| *it /= norm);
            take_off_mean(&mut correlation);
            let (top, height) = highest(&correlation, 0..LAGS);
            self.rows.push(RowShifts {
                azimuth,
                direction: direction(scan, azimuth),
                mps_per_lag: mps_per_lag(scan, rows.layout.cell_m, azimuth),
                correlation,
                top_lag: top as f64 - REACH as f64,
                top: height,
            });
        }
    }
}

impl RowShifts {
    pub fn lag_of(&self, velocity: &Vector2<f64>) -> f64 {
        self.direction.dot(velocity) / self.mps_per_lag
    }

    /// Returns the correlation at a shift; zero where it is negative, or the shift too large.
    pub fn at(&self, lag: f64) -> f32 {
        let place = lag as f32 + REACH as f32;
        if !(0.0..=(LAGS - 1) as f32).contains(&place) {
            return 0.0;
        }
        let below = (place as usize).min(LAGS - 2);
        let [low, high] = [self.correlation[below], self.correlation[below + 1]];
        (low + (place - below as f32) * (high - low)).max(0.0)
    }

    /// Returns the highest peak that is at most so many cells from a shift; `None` without a clear
    /// one.
    pub fn peak_near(&self, lag: f64, window: f64) -> Option<Peak> {
        let middle = lag + REACH as f64;
        let from = (middle - window).ceil().max(1.0);
        let to = (middle + window).floor().min((LAGS - 2) as f64);
        if from > to {
            return None;
        }
        let (at, here) = highest(&self.correlation, from as usize..to as usize + 1);
        let [left, right] = [self.correlation[at - 1], self.correlation[at + 1]];
        let is_peak = here > left && here >= right;
        if !is_peak || here < MIN_HEIGHT || here < MIN_SHARE * self.top {
            return None;
        }
        let [left, here, right] = [left, here, right].map(f64::from);
        let beside = 0.5 * (left - right) / (left - 2.0 * here + right);
        Some(Peak {
            lag: at as f64 - REACH as f64 + beside,
            height: here,
        })
    }
}

fn highest(values: &[f32; WIDTH], places: std::ops::Range<usize>) -> (usize, f32) {
    let mut best = (places.start, values[places.start]);
    for at in places {
        if values[at] > best.1 {
            best = (at, values[at]);
        }
    }
    best
}

fn direction(scan: &PolarScan<'_>, azimuth: usize) -> Vector2<f64> {
    let (sin, cos) = f64::from(scan.azimuth_rad[azimuth]).sin_cos();
    match scan.geometry.sense {
        Sense::Clockwise => Vector2::new(cos, -sin),
        Sense::CounterClockwise => Vector2::new(cos, sin),
    }
}

/// An echo at the range r that is approached with the speed a is measured at r - c a, with the
/// coefficient c of the azimuth.
fn mps_per_lag(scan: &PolarScan<'_>, cell_m: f32, azimuth: usize) -> f64 {
    let coefficient = |of: usize| f64::from(scan.doppler_s(of));
    let beside = 0.5 * (coefficient(azimuth - 1) + coefficient(azimuth + 1));
    f64::from(cell_m) / (coefficient(azimuth) - beside)
}

/// Sums the products of the cells of a row with its neighbours' cells, over all shifts of these:
/// they begin [`REACH`] cells before the row.
#[simd]
fn correlate(row: &[f32], beside: &[f32], sums: &mut [f32; WIDTH]) {
    let mut totals = [0.0_f32; WIDTH];
    for (power, shifted) in row.iter().zip(beside.windows(WIDTH)) {
        if let Some(shifted) = shifted.first_chunk::<WIDTH>().filter(|_| *power > 0.0) {
            for (total, other) in totals.iter_mut().zip(shifted) {
                *total += power * other;
            }
        }
    }
    *sums = totals;
}

fn take_off_mean(values: &mut [f32; WIDTH]) {
    let mut sums = [0.0_f32; LAGS + 1];
    for lag in 0..LAGS {
        sums[lag + 1] = sums[lag] + values[lag];
    }
    for (lag, value) in values[..LAGS].iter_mut().enumerate() {
        let from = lag.saturating_sub(MEAN_LAGS);
        let to = (lag + MEAN_LAGS + 1).min(LAGS);
        *value -= (sums[to] - sums[from]) / (to - from) as f32;
    }
}
