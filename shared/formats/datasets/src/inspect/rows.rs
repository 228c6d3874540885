//! Rows of the scans: validity, losses, chirps, azimuth steps, and ringing near the sensor.

use serde::Serialize;

use gyre_radar::lost::stale_rows;
use gyre_radar::median;
use gyre_radar::scan::{PolarScan, Sense, flag};

/// Number of scans whose powers are averaged to detect ringing.
const POWER_SCANS: usize = 40;
/// Ringing exceeds the mean of all powers by this factor ...
const RINGING_BRIGHTNESS: f64 = 1.5;
/// ... and is nearly constant over azimuth and time: its standard deviation is at most this share
/// of its mean.
const RINGING_VARIATION: f64 = 0.3;
/// Number of consecutive bins without ringing that end it.
const QUIET_BINS: usize = 3;

/// Knowledge of the chirp directions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Chirps {
    /// Unknown.
    Unknown,
    /// Alternately rising and falling.
    Alternating,
    /// Known in some scans and not in others.
    Mixed,
}

/// Summary of the rows of the scans read.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RowsReport {
    /// Number of rows.
    pub rows: u64,
    /// Minimum and maximum number of rows in a scan.
    pub in_scan: (usize, usize),
    /// Rows that were interpolated from their neighbours.
    pub not_measured: u64,
    /// Rows at the end of a scan that still hold the scan before: see [`gyre_radar::lost`].
    pub stale: u64,
    /// Number of scans with such rows.
    pub stale_scans: usize,
    /// Missing rows, where the azimuth makes more than one step.
    pub lost: u64,
    /// Knowledge of the chirp directions.
    pub chirps: Chirps,
    /// Median step between azimuths, degrees.
    pub step_deg: f64,
    /// Minimum and maximum first azimuth, degrees.
    pub first_azimuth_deg: (f64, f64),
    /// Number of range bins, from the sensor outwards, with ringing.
    pub ringing_bins: usize,
}

/// Accumulates [`RowsReport`] over scans.
#[derive(Default)]
pub(super) struct Survey {
    scans: usize,
    with_chirps: usize,
    rows: u64,
    in_scan: Option<(usize, usize)>,
    not_measured: u64,
    stale: u64,
    stale_scans: usize,
    lost: u64,
    steps_rad: Vec<f64>,
    first_rad: Option<(f32, f32)>,
    power_rows: u64,
    /// Sum and sum of squares of the powers of each bin.
    power: Vec<(u64, u64)>,
}

impl Survey {
    pub(super) fn add(&mut self, scan: &PolarScan<'_>) {
        self.scans += 1;
        let rows = scan.flags.len();
        self.rows += rows as u64;
        let (min, max) = self.in_scan.unwrap_or((rows, rows));
        self.in_scan = Some((min.min(rows), max.max(rows)));
        let stale = stale_rows(scan) as u64;
        self.stale += stale;
        self.stale_scans += usize::from(stale > 0);
        let not_measured = |f: &&u8| *f & (flag::MEASURED | flag::STALE) == 0;
        self.not_measured += scan.flags.iter().filter(not_measured).count() as u64;
        self.with_chirps += usize::from(scan.flags.iter().any(|f| f & flag::CHIRP_KNOWN != 0));
        self.add_azimuths(scan);
        if self.scans <= POWER_SCANS {
            self.add_powers(scan);
        }
    }

    fn add_azimuths(&mut self, scan: &PolarScan<'_>) {
        let Some(&first) = scan.azimuth_rad.first() else {
            return;
        };
        let (min, max) = self.first_rad.unwrap_or((first, first));
        self.first_rad = Some((min.min(first), max.max(first)));
        let steps: Vec<f64> = steps_rad(scan).collect();
        let median_rad = median(steps.iter().copied()).unwrap_or(0.0);
        self.lost += steps
            .iter()
            .map(|s| ((s / median_rad).round() as u64).saturating_sub(1))
            .sum::<u64>();
        self.steps_rad.push(median_rad);
    }

    fn add_powers(&mut self, scan: &PolarScan<'_>) {
        self.power
            .resize(scan.geometry.bins.max(self.power.len()), (0, 0));
        self.power_rows += scan.geometry.azimuths as u64;
        for azimuth in 0..scan.geometry.azimuths {
            for (sum, power) in self.power.iter_mut().zip(scan.row(azimuth)) {
                let power = u64::from(*power);
                sum.0 += power;
                sum.1 += power * power;
            }
        }
    }

    pub(super) fn report(&self) -> RowsReport {
        let (min, max) = self.first_rad.unwrap_or_default();
        RowsReport {
            rows: self.rows,
            in_scan: self.in_scan.unwrap_or_default(),
            not_measured: self.not_measured,
            stale: self.stale,
            stale_scans: self.stale_scans,
            lost: self.lost,
            chirps: match self.with_chirps {
                0 => Chirps::Unknown,
                n if n == self.scans => Chirps::Alternating,
                _ => Chirps::Mixed,
            },
            step_deg: median(self.steps_rad.iter().copied())
                .unwrap_or(0.0)
                .to_degrees(),
            first_azimuth_deg: (f64::from(min).to_degrees(), f64::from(max).to_degrees()),
            ringing_bins: self.ringing_bins(),
        }
    }

    fn ringing_bins(&self) -> usize {
        let rows = self.power_rows.max(1) as f64;
        let overall = self.power.iter().map(|(sum, _)| *sum as f64).sum::<f64>()
            / (rows * self.power.len().max(1) as f64);
        let rings = |(sum, squares): &(u64, u64)| {
            let mean = *sum as f64 / rows;
            let deviation = (*squares as f64 / rows - mean * mean).max(0.0).sqrt();
            mean > RINGING_BRIGHTNESS * overall && deviation <= RINGING_VARIATION * mean
        };
        let quiet = self
            .power
            .windows(QUIET_BINS)
            .position(|bins| !bins.iter().any(rings));
        quiet.unwrap_or(0)
    }
}

/// Steps between azimuths, including that from the last to the first, positive in the sense of
/// rotation.
fn steps_rad<'a>(scan: &PolarScan<'a>) -> impl Iterator<Item = f64> + 'a {
    let sign = if scan.geometry.sense == Sense::Clockwise {
        1.0
    } else {
        -1.0
    };
    let next = scan.azimuth_rad.iter().cycle().skip(1);
    scan.azimuth_rad.iter().zip(next).map(move |(a, b)| {
        (sign * (f64::from(*b) - f64::from(*a))).rem_euclid(std::f64::consts::TAU)
    })
}
