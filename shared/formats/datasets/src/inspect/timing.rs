//! Period, jitter, missing scans and stalls of the host.

use serde::Serialize;

use super::{Report, some};
use crate::dataset::Dataset;
use gyre_radar::median;

/// A longer interval on the used clock means missing scans, periods.
const GAP_PERIODS: f64 = 1.5;
/// A longer logged interval means that the host has stalled, periods.
const STALL_PERIODS: f64 = 1.4;
/// Maximum interval while the host catches up after a stall, periods.
const CATCH_UP_PERIODS: f64 = 0.97;
/// Number of scans after a long interval that distinguish a gap from a stall.
const AFTERWARDS: usize = 5;

#[derive(Clone, Debug, Serialize)]
pub(super) struct Timing {
    pub first_ns: i64,
    pub last_ns: i64,
    /// Median time between scans, s; 0 for a single scan.
    period_s: f64,
    /// RMS deviation of the logged intervals from the period, s, without gaps and stalls.
    jitter_s: f64,
    /// Maximum and minimum logged interval, s.
    logged_interval_s: (f64, f64),
    missing_scans: usize,
    gaps: Vec<Gap>,
    stalls: Vec<Stall>,
    /// Scans whose logged stamp is before the stamp of the previous scan.
    backwards: Vec<usize>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Gap {
    /// The first scan after the gap.
    scan: usize,
    missing: usize,
    /// Time between the scans before and after the gap, s.
    seconds: f64,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Stall {
    scan: usize,
    delay_s: f64,
}

impl Timing {
    pub(super) fn add_to(&self, report: &mut Report) {
        let start = self.first_ns as f64 * 1e-9;
        let seconds = (self.last_ns - self.first_ns) as f64 * 1e-9;
        let time = format!("{start:.3} s since 1970, for {seconds:.3} s");
        report.line("time", time);
        let (stalls, gaps) = (self.stalls.len(), self.gaps.len());
        let missing = self.missing_scans;
        if self.period_s > 0.0 {
            let ((max, min), period) = (self.logged_interval_s, self.period_s);
            let jitter = self.jitter_s * 1e3;
            let period = format!(
                "{period:.4} s; logged {min:.3} to {max:.3} s apart, jitter {jitter:.1} ms RMS"
            );
            report.line("period", period);
            let gaps = format!("{missing} scans missing in {gaps} places; {stalls} host stalls");
            report.line("gaps", gaps);
        }
        if stalls > 0 {
            let worst = self.stalls.iter().map(|s| s.delay_s).fold(0.0, f64::max);
            let places = self.stalls.iter();
            let places = some(places.map(|s| format!("{} ({:.2} s)", s.scan, s.delay_s)));
            let times = match stalls {
                1 => "once".to_owned(),
                n => format!("{n} times"),
            };
            report.find(format!(
                "The host stalled {times}, by up to {worst:.2} s, and caught up while the antenna turned uniformly: logged stamps are late from scans {places}."
            ));
        }
        if gaps > 0 {
            let places = self.gaps.iter();
            let places = some(places.map(|g| format!("{} ({} missing)", g.scan, g.missing)));
            let scans = if missing == 1 { "scan is" } else { "scans are" };
            report.find(format!("{missing} {scans} missing, before scans {places}."));
        }
        if !self.backwards.is_empty() {
            let places = some(self.backwards.iter().map(ToString::to_string));
            report.find(format!("Logged time runs backwards at scans {places}."));
        }
    }
}

/// Examines the times of all scans; `None` if a scan has no time.
pub(super) fn examine(dataset: &dyn Dataset) -> Option<Timing> {
    let all = || 0..dataset.len();
    let used: Option<Vec<i64>> = all().map(|i| dataset.nominal_stamp_ns(i)).collect();
    let logged: Option<Vec<i64>> = all().map(|i| dataset.logged_stamp_ns(i)).collect();
    times(&used?, &logged?)
}

/// `used` are the times that the scans are read with, `logged` those recorded by the host.
fn times(used: &[i64], logged: &[i64]) -> Option<Timing> {
    let (used_s, logged_s) = (intervals_s(used), intervals_s(logged));
    let period_s = median(used_s.iter().copied()).unwrap_or(0.0);
    let delay_s = lateness_s(used, logged);
    let (mut gaps, mut stalls, mut backwards) = (Vec::new(), Vec::new(), Vec::new());
    for (scan, (&on_clock, &on_host)) in (1..).zip(used_s.iter().zip(&logged_s)) {
        let is_long = period_s > 0.0 && on_clock > GAP_PERIODS * period_s;
        if is_long && !catches_up(&logged_s[scan..], period_s) {
            let missing = ((on_clock / period_s).round() as u32 - 1) as usize;
            gaps.push(Gap {
                scan,
                missing,
                seconds: on_clock,
            });
        } else if period_s > 0.0 && on_host > STALL_PERIODS * period_s {
            stalls.push(Stall {
                scan,
                delay_s: delay_s[scan].max(on_host - period_s),
            });
        } else if on_host < 0.0 {
            backwards.push(scan);
        }
    }
    let bound = |of: fn(f64, f64) -> f64| logged_s.iter().copied().reduce(of).unwrap_or(0.0);
    Some(Timing {
        first_ns: *used.first()?,
        last_ns: *used.last()?,
        period_s,
        jitter_s: jitter_s(&logged_s, period_s),
        logged_interval_s: (bound(f64::max), bound(f64::min)),
        missing_scans: gaps.iter().map(|g| g.missing).sum(),
        gaps,
        stalls,
        backwards,
    })
}

fn intervals_s(stamps: &[i64]) -> Vec<f64> {
    let steps = stamps.windows(2);
    steps.map(|w| (w[1] - w[0]) as f64 * 1e-9).collect()
}

fn lateness_s(used: &[i64], logged: &[i64]) -> Vec<f64> {
    let late: Vec<i64> = logged.iter().zip(used).map(|(l, u)| l - u).collect();
    let prompt = late.iter().copied().min().unwrap_or(0);
    late.iter().map(|l| (l - prompt) as f64 * 1e-9).collect()
}

/// Returns whether the scans after a long interval arrive faster than the sensor period.
fn catches_up(afterwards: &[f64], period_s: f64) -> bool {
    let next = afterwards.iter().copied().take(AFTERWARDS);
    let next = next.take_while(|s| *s < STALL_PERIODS * period_s);
    median(next).is_some_and(|s| s < CATCH_UP_PERIODS * period_s)
}

fn jitter_s(logged_s: &[f64], period_s: f64) -> f64 {
    let apart = logged_s.iter().map(|s| s - period_s);
    let regular = apart.filter(|d| d.abs() < (STALL_PERIODS - 1.0) * period_s);
    let regular: Vec<f64> = regular.collect();
    let squares = regular.iter().map(|d| d * d).sum::<f64>();
    (squares / regular.len().max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    fn uniform(n: i64) -> Vec<i64> {
        let stamps = (0..n).map(|k| 1_549_986_607_000 * MS + k * 250 * MS);
        stamps.collect()
    }

    #[test]
    fn a_stall_with_catching_up_is_not_a_gap() {
        let mut logged = uniform(30);
        for (k, late) in [900, 700, 500, 300, 100].into_iter().enumerate() {
            logged[10 + k] += late * MS;
        }
        for used in [uniform(30), logged.clone()] {
            let report = times(&used, &logged).unwrap();
            assert_eq!(report.missing_scans, 0, "{:?}", report.gaps);
            assert_eq!(report.stalls.len(), 1);
            assert_eq!(report.stalls[0].scan, 10);
            assert!((report.stalls[0].delay_s - 0.9).abs() < 1e-9, "{report:?}");
        }
    }

    #[test]
    fn one_scan_has_no_period_and_time_that_runs_backwards_is_detected() {
        let report = times(&uniform(1), &uniform(1)).unwrap();
        assert_eq!([report.period_s, report.jitter_s], [0.0; 2]);
        let mut logged = uniform(9);
        logged[4] -= 400 * MS;
        assert_eq!(times(&uniform(9), &logged).unwrap().backwards, [4]);
    }
}
