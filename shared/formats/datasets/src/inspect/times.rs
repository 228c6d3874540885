//! The stamps of a log of samples beside the scans.

use gyre_radar::median;
use serde::Serialize;

use super::TimingReport;

/// The stamps of a log.
#[derive(Clone, Debug, Default, Serialize)]
pub struct LogTimes {
    /// Number of samples that can be used.
    pub samples: usize,
    /// Median rate, Hz.
    pub rate_hz: f64,
    /// RMS deviation of the time between samples from its median, s, without gaps.
    pub jitter_s: f64,
    /// First and last stamp, ns, on the log's own clock.
    pub span_ns: Option<[i64; 2]>,
    /// Samples that are missing between them, share of all.
    pub missing: f64,
    /// First and last stamp against those of the scans, s.
    pub after_scans_s: Option<[f64; 2]>,
}

impl LogTimes {
    /// Examines stamps, ns, in their order.
    pub(super) fn of(stamps: &[i64], timing: Option<&TimingReport>) -> Self {
        let steps = stamps.windows(2).map(|pair| apart_s(pair[1], pair[0]));
        let steps_s: Vec<f64> = steps.collect();
        let period_s = median(steps_s.iter().copied()).unwrap_or_default();
        let regular = steps_s.iter().map(|step_s| step_s - period_s);
        let regular: Vec<f64> = regular.filter(|apart_s| *apart_s < period_s).collect();
        let squares: f64 = regular.iter().map(|apart_s| apart_s * apart_s).sum();
        let span = stamps.first().copied().zip(stamps.last().copied());
        let slots = span.map_or(0.0, |(first, last)| {
            apart_s(last, first) / period_s.max(1e-9) + 1.0
        });
        Self {
            samples: stamps.len(),
            rate_hz: if period_s > 0.0 { 1.0 / period_s } else { 0.0 },
            jitter_s: (squares / regular.len().max(1) as f64).sqrt(),
            span_ns: span.map(Into::into),
            missing: (1.0 - stamps.len() as f64 / slots.max(1.0)).max(0.0),
            after_scans_s: span.zip(timing).map(|((first, last), timing)| {
                [
                    apart_s(first, timing.first_ns),
                    apart_s(last, timing.last_ns),
                ]
            }),
        }
    }

    /// Returns whether the stamps cover those of the scans; true where either has none.
    pub(super) fn cover_scans(&self) -> bool {
        let after = self.after_scans_s;
        after.is_none_or(|[first_s, last_s]| first_s <= 0.0 && last_s >= 0.0)
    }
}

fn apart_s(stamp_ns: i64, from_ns: i64) -> f64 {
    (i128::from(stamp_ns) - i128::from(from_ns)) as f64 * 1e-9
}
