//! How far two recordings are from each other, statistic by statistic.
//!
//! Lengths, shares and errors are compared by the magnitude of the natural logarithm of their ratio: 0.1 is a tenth more or less,
//! 0.69 twice or half.

use serde::Serialize;

use crate::realism::{Change, Curve, Measured, Recording, SearchErrors};

/// Added to both shares before they are compared, so that a share of nothing has a ratio too.
const SHARE_FLOOR: f64 = 1e-6;
/// The same for saturated bins: a few of them are chance.
const SATURATED_FLOOR: f64 = 1e-5;
/// Ranges at which the mean power is shown, m.
const SHOWN_RANGES_M: [f64; 2] = [10.0, 80.0];

/// All statistics of a simulated and a real recording, and of another real one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// One a statistic.
    pub rows: Vec<Row>,
    /// Rows in which the simulated recording is closer to the real one than the other real one is.
    pub closer: usize,
    /// Rows that both distances are known of.
    pub judged: usize,
}

/// A statistic.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// What it is.
    pub statistic: &'static str,
    /// Its distance, with the unit.
    pub distance: &'static str,
    /// As it reads for the simulated, the real and the other real recording; `None` where it is not known.
    pub values: [Option<String>; 3],
    /// From one half of the real recording to its other half: less than this means nothing.
    pub within_real: Option<f64>,
    /// From one half of the other real recording to its other half.
    pub within_other: Option<f64>,
    /// From the simulated to the real recording.
    pub sim_real: Option<f64>,
    /// From the real recording to the other.
    pub real_other: Option<f64>,
    /// Whether the first distance is less than the second.
    pub closer: Option<bool>,
}

impl Row {
    /// Whether the simulated recording is no farther from the real one than halves of one real recording are from each other: two
    /// real recordings may be closer still, by chance.
    pub fn is_within_chance(&self) -> bool {
        let chance = [self.within_real, self.within_other]
            .into_iter()
            .flatten()
            .reduce(f64::max);
        self.sim_real
            .zip(chance)
            .is_some_and(|(distance, chance)| distance <= chance)
    }
}

/// Compares `sim` with `real`, and `real` with another real recording.
pub fn compare(sim: &Measured, real: &Measured, other: Option<&Measured>) -> Comparison {
    let row = |statistic: &Statistic| {
        let between = |a: &Measured, b: &Measured| (statistic.between)(&a.whole, &b.whole);
        let within = |measured: &Measured| {
            let [first, second] = measured.halves.as_ref()?;
            (statistic.between)(first, second)
        };
        let sim_real = between(sim, real);
        let real_other = other.and_then(|other| between(real, other));
        Row {
            statistic: statistic.name,
            distance: statistic.distance,
            values: [Some(sim), Some(real), other]
                .map(|measured| (statistic.shown)(&measured?.whole)),
            within_real: within(real),
            within_other: other.and_then(within),
            sim_real,
            real_other,
            closer: sim_real
                .zip(real_other)
                .map(|(sim_real, real_other)| sim_real < real_other),
        }
    };
    let rows: Vec<Row> = STATISTICS.iter().map(row).collect();
    let verdicts = || rows.iter().filter_map(|row| row.closer);
    Comparison {
        closer: verdicts().filter(|closer| *closer).count(),
        judged: verdicts().count(),
        rows,
    }
}

/// How a statistic is shown and compared; `None` where a recording has none or the distance is no number.
struct Statistic {
    name: &'static str,
    distance: &'static str,
    shown: fn(&Recording) -> Option<String>,
    between: fn(&Recording, &Recording) -> Option<f64>,
}

const LOG_RATIO: &str = "abs. log ratio";

/// All of them. To add one, add an entry.
static STATISTICS: [Statistic; 14] = [
    Statistic {
        name: "histogram of power",
        distance: "Wasserstein, counts",
        shown: |recording| {
            let percentile = |share| recording.statistics.histogram.percentile(share);
            Some(format!(
                "50 %: {}, 90 %: {}, 99 %: {}",
                percentile(0.5),
                percentile(0.9),
                percentile(0.99)
            ))
        },
        between: |a, b| finite(a.statistics.histogram.wasserstein(&b.statistics.histogram)),
    },
    Statistic {
        name: "mean power against range",
        distance: "RMS, counts",
        shown: |recording| {
            let at = |range_m: f64| {
                let power = recording.statistics.mean_power_at(range_m)?;
                Some(format!("{range_m} m: {power:.1}"))
            };
            let shown: Vec<String> = SHOWN_RANGES_M.into_iter().filter_map(at).collect();
            (!shown.is_empty()).then(|| shown.join(", "))
        },
        between: |a, b| rms_difference(&a.statistics.mean_power, &b.statistics.mean_power),
    },
    Statistic {
        name: "correlation length in range",
        distance: LOG_RATIO,
        shown: |recording| shown_length(&recording.statistics.range_correlation, "m"),
        between: |a, b| {
            by(
                a,
                b,
                |recording| recording.statistics.range_correlation.length(),
                log_ratio,
            )
        },
    },
    Statistic {
        name: "correlation length in azimuth",
        distance: LOG_RATIO,
        shown: |recording| shown_length(&recording.statistics.azimuth_correlation, "deg"),
        between: |a, b| {
            by(
                a,
                b,
                |recording| recording.statistics.azimuth_correlation.length(),
                log_ratio,
            )
        },
    },
    Statistic {
        name: "share of saturated bins",
        distance: LOG_RATIO,
        shown: |recording| Some(format!("{:.1e}", recording.statistics.saturated_share)),
        between: |a, b| {
            by(
                a,
                b,
                |recording| Some(recording.statistics.saturated_share),
                saturated_ratio,
            )
        },
    },
    Statistic {
        name: "share above the threshold",
        distance: LOG_RATIO,
        shown: |recording| Some(percent(recording.statistics.share_above)),
        between: |a, b| {
            by(
                a,
                b,
                |recording| Some(recording.statistics.share_above),
                share_ratio,
            )
        },
    },
    Statistic {
        name: "next scan: correlation",
        distance: "abs. difference",
        shown: |recording| Some(format!("{:.3}", change(recording)?.correlation)),
        between: |a, b| {
            by(
                a,
                b,
                |recording| Some(change(recording)?.correlation),
                |a, b| (a - b).abs(),
            )
        },
    },
    Statistic {
        name: "next scan: returns without counterpart",
        distance: LOG_RATIO,
        shown: |recording| Some(percent(change(recording)?.unmatched_share)),
        between: |a, b| {
            by(
                a,
                b,
                |recording| Some(change(recording)?.unmatched_share),
                share_ratio,
            )
        },
    },
    Statistic {
        name: "plain search: translation of a motion",
        distance: LOG_RATIO,
        shown: |recording| metres(plain(recording)?.translation_rmse_m),
        between: |a, b| {
            by(
                a,
                b,
                |recording| Some(plain(recording)?.translation_rmse_m),
                log_ratio,
            )
        },
    },
    Statistic {
        name: "plain search: rotation of a motion",
        distance: LOG_RATIO,
        shown: |recording| degrees(plain(recording)?.rotation_rmse_deg),
        between: |a, b| {
            by(
                a,
                b,
                |recording| Some(plain(recording)?.rotation_rmse_deg),
                log_ratio,
            )
        },
    },
    Statistic {
        name: "plain search: seg",
        distance: LOG_RATIO,
        shown: |recording| Some(percent(plain(recording)?.seg_percent? / 100.0)),
        between: |a, b| by(a, b, |recording| plain(recording)?.seg_percent, log_ratio),
    },
    Statistic {
        name: "refined search: translation of a motion",
        distance: LOG_RATIO,
        shown: |recording| metres(refined(recording)?.translation_rmse_m),
        between: |a, b| {
            by(
                a,
                b,
                |recording| Some(refined(recording)?.translation_rmse_m),
                log_ratio,
            )
        },
    },
    Statistic {
        name: "refined search: rotation of a motion",
        distance: LOG_RATIO,
        shown: |recording| degrees(refined(recording)?.rotation_rmse_deg),
        between: |a, b| {
            by(
                a,
                b,
                |recording| Some(refined(recording)?.rotation_rmse_deg),
                log_ratio,
            )
        },
    },
    Statistic {
        name: "refined search: seg",
        distance: LOG_RATIO,
        shown: |recording| Some(percent(refined(recording)?.seg_percent? / 100.0)),
        between: |a, b| by(a, b, |recording| refined(recording)?.seg_percent, log_ratio),
    },
];

/// The distance of a number that both recordings have.
fn by(
    a: &Recording,
    b: &Recording,
    of: fn(&Recording) -> Option<f64>,
    distance: fn(f64, f64) -> f64,
) -> Option<f64> {
    finite(distance(of(a)?, of(b)?))
}

fn finite(distance: f64) -> Option<f64> {
    distance.is_finite().then_some(distance)
}

fn log_ratio(a: f64, b: f64) -> f64 {
    (a / b).ln().abs()
}

fn share_ratio(a: f64, b: f64) -> f64 {
    log_ratio(a + SHARE_FLOOR, b + SHARE_FLOOR)
}

fn saturated_ratio(a: f64, b: f64) -> f64 {
    log_ratio(a + SATURATED_FLOOR, b + SATURATED_FLOOR)
}

/// Over as much of the range as both have.
fn rms_difference(a: &[f64], b: &[f64]) -> Option<f64> {
    let squares = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b));
    finite((squares.sum::<f64>() / a.len().min(b.len()) as f64).sqrt())
}

fn change(recording: &Recording) -> Option<&Change> {
    recording.statistics.change.as_ref()
}

fn plain(recording: &Recording) -> Option<&SearchErrors> {
    recording.plain.as_ref()
}

fn refined(recording: &Recording) -> Option<&SearchErrors> {
    recording.refined.as_ref()
}

fn shown_length(curve: &Curve, unit: &str) -> Option<String> {
    match curve.length() {
        Some(length) => Some(format!("{length:.2} {unit}")),
        None => {
            let longest = curve.values.len().checked_sub(1)? as f64 * curve.step;
            Some(format!("over {longest:.1} {unit}"))
        }
    }
}

fn metres(length_m: f64) -> Option<String> {
    Some(format!("{length_m:.3} m"))
}

fn degrees(angle_deg: f64) -> Option<String> {
    Some(format!("{angle_deg:.3} deg"))
}

fn percent(share: f64) -> String {
    format!("{:.2} %", 100.0 * share)
}
