//! Period, jitter, missing scans and stalls of the host.

use serde::Serialize;

use crate::dataset::Dataset;
use crate::median::median;

/// An interval longer than this many periods, on the clock that is used, is a gap.
const GAP_PERIODS: f64 = 1.5;
/// A logged interval longer than this many periods is a stall of the host.
const STALL_PERIODS: f64 = 1.4;
/// After a stall the host takes in scans faster than the sensor makes them: at most this many periods apart.
const CATCH_UP_PERIODS: f64 = 0.97;
/// Scans after a long interval by which a gap is told from a stall.
const AFTERWARDS: usize = 5;

/// The times of a dataset's scans. Indices count scans from 0.
#[derive(Clone, Debug, Serialize)]
pub struct TimingReport {
    /// First scan's time, ns since 1970.
    pub first_ns: i64,
    /// Last scan's time, ns since 1970.
    pub last_ns: i64,
    /// Median time between scans, s; 0 for a single scan.
    pub period_s: f64,
    /// RMS deviation of the logged intervals from the period, s, gaps and stalls left out.
    pub jitter_s: f64,
    /// Longest and shortest logged interval, s.
    pub logged_interval_s: (f64, f64),
    /// Scans that are missing between the first and the last.
    pub missing_scans: usize,
    /// Where they are missing.
    pub gaps: Vec<Gap>,
    /// Where the host stalled: stamps were logged late, and no scan is missing.
    pub stalls: Vec<Stall>,
    /// Scans whose logged stamp lies before that of the scan before.
    pub backwards: Vec<usize>,
}

/// Missing scans.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Gap {
    /// The first scan after the gap.
    pub scan: usize,
    /// How many are missing.
    pub missing: usize,
    /// From the scan before the gap to the one after, s.
    pub seconds: f64,
}

/// A stall of the host.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Stall {
    /// The first scan that came late.
    pub scan: usize,
    /// How late its stamp is, s.
    pub late_s: f64,
}

/// `None` where not every scan has a time.
pub(super) fn examine(dataset: &dyn Dataset) -> Option<TimingReport> {
    let all = 0..dataset.len();
    let used: Vec<i64> = all
        .clone()
        .map(|i| dataset.nominal_stamp_ns(i))
        .collect::<Option<_>>()?;
    let logged: Vec<i64> = all
        .map(|i| dataset.logged_stamp_ns(i))
        .collect::<Option<_>>()?;
    times(&used, &logged)
}

/// `used`: the clock that the scans are read with; `logged`: as written down by the host.
fn times(used: &[i64], logged: &[i64]) -> Option<TimingReport> {
    let (used_s, logged_s) = (intervals_s(used), intervals_s(logged));
    let period_s = median(used_s.iter().copied()).unwrap_or(0.0);
    let late_s = lateness_s(used, logged);
    let (mut gaps, mut stalls, mut backwards) = (Vec::new(), Vec::new(), Vec::new());
    for (i, (on_clock, on_host)) in used_s
        .iter()
        .copied()
        .zip(logged_s.iter().copied())
        .enumerate()
    {
        let scan = i + 1;
        if period_s > 0.0
            && on_clock > GAP_PERIODS * period_s
            && !catches_up(&logged_s[scan..], period_s)
        {
            let missing = ((on_clock / period_s).round() as u32 - 1) as usize;
            gaps.push(Gap {
                scan,
                missing,
                seconds: on_clock,
            });
        } else if period_s > 0.0 && on_host > STALL_PERIODS * period_s {
            stalls.push(Stall {
                scan,
                late_s: late_s[scan].max(on_host - period_s),
            });
        } else if on_host < 0.0 {
            backwards.push(scan);
        }
    }
    Some(TimingReport {
        first_ns: *used.first()?,
        last_ns: *used.last()?,
        period_s,
        jitter_s: jitter_s(&logged_s, period_s),
        logged_interval_s: extremes(&logged_s),
        missing_scans: gaps.iter().map(|g| g.missing).sum(),
        gaps,
        stalls,
        backwards,
    })
}

fn intervals_s(stamps: &[i64]) -> Vec<f64> {
    stamps
        .windows(2)
        .map(|w| (w[1] - w[0]) as f64 * 1e-9)
        .collect()
}

/// How late each stamp was logged, against the most prompt one.
fn lateness_s(used: &[i64], logged: &[i64]) -> Vec<f64> {
    let late: Vec<i64> = logged.iter().zip(used).map(|(l, u)| l - u).collect();
    let prompt = late.iter().copied().min().unwrap_or(0);
    late.iter().map(|l| (l - prompt) as f64 * 1e-9).collect()
}

/// Whether the scans that follow a long interval come faster than the sensor makes them.
fn catches_up(afterwards: &[f64], period_s: f64) -> bool {
    let next = afterwards
        .iter()
        .copied()
        .take(AFTERWARDS)
        .take_while(|s| *s < STALL_PERIODS * period_s);
    median(next).is_some_and(|s| s < CATCH_UP_PERIODS * period_s)
}

fn jitter_s(logged_s: &[f64], period_s: f64) -> f64 {
    let ordinary = || {
        logged_s
            .iter()
            .map(|s| s - period_s)
            .filter(|d| d.abs() < (STALL_PERIODS - 1.0) * period_s)
    };
    let count = ordinary().count().max(1);
    (ordinary().map(|d| d * d).sum::<f64>() / count as f64).sqrt()
}

fn extremes(values: &[f64]) -> (f64, f64) {
    let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    if values.is_empty() {
        (0.0, 0.0)
    } else {
        (most, least)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    const MS: i64 = 1_000_000;

    fn even(n: i64) -> Vec<i64> {
        (0..n)
            .map(|k| 1_549_986_607_000 * MS + k * 250 * MS)
            .collect()
    }

    #[test]
    fn a_gap_is_counted_and_no_stall() {
        let mut stamps = even(20);
        stamps.drain(7..10);
        let report = times(&stamps, &stamps).unwrap();
        assert_eq!(
            report.gaps,
            [Gap {
                scan: 7,
                missing: 3,
                seconds: 1.0
            }]
        );
        assert_eq!((report.missing_scans, report.stalls.len()), (3, 0));
        assert!((report.period_s - 0.25).abs() < 1e-9 && report.jitter_s < 1e-9);
    }

    #[test]
    fn a_stall_that_is_caught_up_is_no_gap() {
        let mut logged = even(30);
        for (k, late) in [900, 700, 500, 300, 100].into_iter().enumerate() {
            logged[10 + k] += late * MS;
        }
        for used in [even(30), logged.clone()] {
            let report = times(&used, &logged).unwrap();
            assert_eq!(report.missing_scans, 0, "{:?}", report.gaps);
            assert_eq!(report.stalls.len(), 1);
            assert_eq!(report.stalls[0].scan, 10);
            assert!(
                (report.stalls[0].late_s - 0.9).abs() < 1e-9,
                "{}",
                report.stalls[0].late_s
            );
        }
    }

    #[test]
    fn one_scan_has_no_period() {
        let report = times(&even(1), &even(1)).unwrap();
        assert_eq!(
            (report.period_s, report.jitter_s, report.missing_scans),
            (0.0, 0.0, 0)
        );
    }

    #[test]
    fn time_that_runs_backwards_is_found() {
        let mut logged = even(9);
        logged[4] -= 400 * MS;
        assert_eq!(times(&even(9), &logged).unwrap().backwards, [4]);
    }
}
