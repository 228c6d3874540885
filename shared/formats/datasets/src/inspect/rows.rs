//! Rows of the scans: validity, losses, chirps, azimuth steps, and ringing near the sensor.

use gyre_geometry::scan::{PolarScan, Sense, SweepGeometry, flag};
use gyre_radar::{lost::stale_rows, median};
use serde_json::json;

use super::Report;

/// Number of scans whose powers are averaged to detect ringing.
const POWER_SCANS: usize = 40;
/// Ringing exceeds the mean of all powers by this factor ...
const RINGING_BRIGHTNESS: f64 = 1.5;
/// ... and is nearly constant over azimuth and time: its standard deviation is at most this share
/// of its mean.
const RINGING_VARIATION: f64 = 0.3;
/// Number of consecutive bins without ringing that end it.
const QUIET_BINS: usize = 3;

#[derive(Default)]
pub(super) struct Survey {
    scans: usize,
    with_chirps: usize,
    rows: u64,
    in_scan: Option<(usize, usize)>,
    not_measured: u64,
    /// Rows at the end of a scan that still hold the scan before: see [`gyre_radar::lost`].
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
        let lost = |step: &f64| ((step / median_rad).round() as u64).saturating_sub(1);
        self.lost += steps.iter().map(lost).sum::<u64>();
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

    pub(super) fn most_rows(&self) -> usize {
        self.in_scan.unwrap_or_default().1
    }

    pub(super) fn lines(&self, report: &mut Report, encoder_counts: Option<u16>) {
        let source = encoder_counts.map_or("uniform".to_owned(), |counts| {
            format!("encoder of {counts} counts per turn")
        });
        let step_deg = median(self.steps_rad.iter().copied()).unwrap_or(0.0);
        let step_deg = step_deg.to_degrees();
        let (min, max) = self.first_rad.unwrap_or_default();
        let (min, max) = (f64::from(min).to_degrees(), f64::from(max).to_degrees());
        let first = match max - min < 0.005 {
            true => format!("{min:.2}"),
            false => format!("{min:.2} to {max:.2}"),
        };
        let azimuths = format!("{source}, step {step_deg:.3} deg, first at {first} deg");
        report.line("azimuths", azimuths);
        report.figure("encoder_counts", encoder_counts);
        let (chirps, words) = match self.with_chirps {
            0 => ("unknown", "unknown"),
            n if n == self.scans => ("alternating", "alternating"),
            _ => ("mixed", "known in some scans"),
        };
        let (rows, not_measured, lost) = (self.rows, self.not_measured, self.lost);
        let text = format!("{rows}, {not_measured} not measured, {lost} lost; chirps {words}");
        report.line("rows", text);
        let figures = json!({
            "rows": rows,
            "in_scan": self.in_scan.unwrap_or_default(),
            "not_measured": not_measured,
            "stale": self.stale,
            "stale_scans": self.stale_scans,
            "lost": lost,
            "chirps": chirps,
            "step_deg": step_deg,
            "first_azimuth_deg": [min, max],
            "ringing_bins": self.ringing_bins(),
        });
        report.figure("rows", figures);
    }

    pub(super) fn findings(
        &self,
        report: &mut Report,
        scans_read: usize,
        geometry: &SweepGeometry,
    ) {
        let (rows, not_measured, lost) = (self.rows, self.not_measured, self.lost);
        if not_measured > 0 {
            let percent = 100.0 * not_measured as f64 / rows.max(1) as f64;
            report.find(format!(
                "{not_measured} of {rows} rows ({percent:.2} %) were not measured but interpolated from their neighbours."
            ));
        }
        if self.stale > 0 {
            let (scans, stale) = (self.stale_scans, self.stale);
            report.find(format!(
                "{scans} of {scans_read} scans have lost azimuths, {stale} in all: the rows behind each have moved up by one, and the last rows are still those of the scan before. Odometry finds where they were lost (dataset.lost_azimuths)."
            ));
        }
        let (fewest, most) = self.in_scan.unwrap_or_default();
        if fewest < most {
            report.find(format!(
                "Scans have {fewest} to {most} rows: some have lost azimuths, and are read with those that there are."
            ));
        }
        if lost > 0 {
            report.find(format!("{lost} rows are lost: the azimuth jumps."));
        }
        if self.with_chirps > 0 && self.with_chirps < self.scans {
            report.find("The directions of the chirps are known in some scans only.".to_owned());
        }
        let ringing = self.ringing_bins();
        if ringing > 0 {
            let to_m = ringing as f32 * geometry.range_resolution_m + geometry.range_offset_m;
            let last = ringing - 1;
            report.find(format!(
                "Range bins 0 to {last} (to {to_m:.1} m) are ringing of the sensor: uniform over azimuth, and stronger than the scene; set the minimum range above that."
            ));
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
        let mut windows = self.power.windows(QUIET_BINS);
        let quiet = windows.position(|bins| !bins.iter().any(rings));
        quiet.unwrap_or(0)
    }
}

/// Steps between azimuths, including that from the last to the first, positive in the sense of
/// rotation.
fn steps_rad<'a>(scan: &PolarScan<'a>) -> impl Iterator<Item = f64> + 'a {
    let sign = match scan.geometry.sense {
        Sense::Clockwise => 1.0,
        _ => -1.0,
    };
    let next = scan.azimuth_rad.iter().cycle().skip(1);
    scan.azimuth_rad.iter().zip(next).map(move |(a, b)| {
        (sign * (f64::from(*b) - f64::from(*a))).rem_euclid(std::f64::consts::TAU)
    })
}
