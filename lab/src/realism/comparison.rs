//! Distances between two recordings, statistic by statistic.
//!
//! Lengths, shares and errors are compared by the magnitude of the natural logarithm of their ratio: 0.1 is a tenth more or less,
//! 0.69 twice or half.

use serde::Serialize;

use super::recording::{Measured, Recording};

/// All statistics of a simulated and a real recording, and of another real one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// One row a statistic.
    pub rows: Vec<Row>,
    /// Rows in which the simulated recording is closer to the real one than the other real one is.
    pub closer: usize,
    /// Rows in which both distances are known.
    pub judged: usize,
}

/// A statistic.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// The name.
    pub statistic: &'static str,
    /// The kind of distance, with the unit.
    pub distance: &'static str,
    /// The value for the simulated, the real and the other real recording; `None` where it is not known.
    pub values: [Option<String>; 3],
    /// From one half of the real recording to its other half: less than this means nothing.
    pub within_real: Option<f64>,
    /// From one half of the other real recording to its other half.
    pub within_other: Option<f64>,
    /// From the simulated to the real recording.
    pub sim_real: Option<f64>,
    /// From the real recording to the other.
    pub real_other: Option<f64>,
    /// True if the first distance is less than the second.
    pub closer: Option<bool>,
}

impl Row {
    /// Returns whether the simulated recording is no farther from the real one than halves of one real recording are from each other:
    /// two real recordings may be closer still, by chance.
    pub fn is_within_chance(&self) -> bool {
        let halves = [self.within_real, self.within_other];
        let chance = halves.into_iter().flatten().reduce(f64::max);
        self.sim_real
            .zip(chance)
            .is_some_and(|(distance, chance)| distance <= chance)
    }
}

/// Compares `sim` with `real`, and `real` with another real recording.
pub fn compare(sim: &Measured, real: &Measured, other: Option<&Measured>) -> Comparison {
    let row = |(statistic, kind): &(&'static str, Kind)| {
        let within = |measured: &Measured| {
            let [first, second] = measured.halves.as_ref()?;
            kind.between(first, second)
        };
        let sim_real = kind.between(&sim.whole, &real.whole);
        let real_other = other.and_then(|other| kind.between(&real.whole, &other.whole));
        Row {
            statistic,
            distance: kind.distance(),
            values: [Some(sim), Some(real), other].map(|measured| kind.shown(&measured?.whole)),
            within_real: within(real),
            within_other: other.and_then(within),
            sim_real,
            real_other,
            closer: sim_real.zip(real_other).map(|(sim, other)| sim < other),
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

/// The kind of a statistic: how it is shown and compared.
enum Kind {
    Histogram,
    MeanPower,
    /// A number that a recording may lack.
    Number(Unit, fn(&Recording) -> Option<f64>),
}

/// The unit of a number, and how two are compared.
#[derive(Clone, Copy)]
struct Unit {
    suffix: &'static str,
    factor: f64,
    decimals: usize,
    /// Added to both numbers before their ratio is taken, so that a share of nothing has one too. `None`: the difference is taken.
    floor: Option<f64>,
}

const fn unit(suffix: &'static str, factor: f64, decimals: usize, floor: f64) -> Unit {
    Unit {
        suffix,
        factor,
        decimals,
        floor: Some(floor),
    }
}

const METRES: Unit = unit(" m", 1.0, 3, 0.0);
const DEGREES: Unit = unit(" deg", 1.0, 3, 0.0);
const PERCENT: Unit = unit(" %", 1.0, 2, 0.0);
const SHARE: Unit = unit(" %", 100.0, 2, 1e-6);
/// A few saturated bins are chance.
const SATURATED: Unit = unit(" %", 100.0, 4, 1e-5);
const COEFFICIENT: Unit = Unit {
    floor: None,
    ..unit("", 1.0, 3, 0.0)
};

/// The statistics. To add one, add an entry.
static STATISTICS: [(&str, Kind); 14] = [
    ("histogram of power", Kind::Histogram),
    ("mean power against range", Kind::MeanPower),
    (
        "correlation length in range",
        Kind::Number(METRES, |r| r.statistics.range_correlation.length()),
    ),
    (
        "correlation length in azimuth",
        Kind::Number(DEGREES, |r| r.statistics.azimuth_correlation.length()),
    ),
    (
        "share of saturated bins",
        Kind::Number(SATURATED, |r| Some(r.statistics.saturated_share)),
    ),
    (
        "share above the threshold",
        Kind::Number(SHARE, |r| Some(r.statistics.share_above)),
    ),
    (
        "next scan: correlation",
        Kind::Number(COEFFICIENT, |r| Some(r.statistics.change?.correlation)),
    ),
    (
        "next scan: returns without counterpart",
        Kind::Number(SHARE, |r| Some(r.statistics.change?.unmatched_share)),
    ),
    (
        "plain search: translation of a motion",
        Kind::Number(METRES, |r| r.plain.get("rpe/translation_rmse_m").copied()),
    ),
    (
        "plain search: rotation of a motion",
        Kind::Number(DEGREES, |r| r.plain.get("rpe/rotation_rmse_deg").copied()),
    ),
    (
        "plain search: seg",
        Kind::Number(PERCENT, |r| r.plain.get("seg/percent").copied()),
    ),
    (
        "refined search: translation of a motion",
        Kind::Number(METRES, |r| r.refined.get("rpe/translation_rmse_m").copied()),
    ),
    (
        "refined search: rotation of a motion",
        Kind::Number(DEGREES, |r| r.refined.get("rpe/rotation_rmse_deg").copied()),
    ),
    (
        "refined search: seg",
        Kind::Number(PERCENT, |r| r.refined.get("seg/percent").copied()),
    ),
];

impl Kind {
    fn distance(&self) -> &'static str {
        match self {
            Self::Histogram => "Wasserstein, counts",
            Self::MeanPower => "RMS, counts",
            Self::Number(Unit { floor: None, .. }, _) => "abs. difference",
            Self::Number(..) => "abs. log ratio",
        }
    }

    fn shown(&self, recording: &Recording) -> Option<String> {
        let statistics = &recording.statistics;
        match self {
            Self::Histogram => {
                let percentile = |share| statistics.histogram.percentile(share);
                let [median, high, top] = [0.5, 0.9, 0.99].map(percentile);
                Some(format!("50 %: {median}, 90 %: {high}, 99 %: {top}"))
            }
            Self::MeanPower => {
                let at = |range_m| statistics.around(range_m, |cell| statistics.mean_power[cell]);
                Some(format!("10 m: {:.1}", at(10.0)?))
            }
            Self::Number(unit, of) => {
                let value = of(recording)? * unit.factor;
                Some(format!("{value:.*}{}", unit.decimals, unit.suffix))
            }
        }
    }

    /// `None` where a recording lacks the statistic, or the distance is not finite.
    fn between(&self, a: &Recording, b: &Recording) -> Option<f64> {
        let (s, t) = (&a.statistics, &b.statistics);
        let distance = match self {
            Self::Histogram => s.histogram.wasserstein(&t.histogram),
            Self::MeanPower => rms_difference(&s.mean_power, &t.mean_power),
            Self::Number(unit, of) => match (of(a)?, of(b)?, unit.floor) {
                (a, b, Some(floor)) => ((a + floor) / (b + floor)).ln().abs(),
                (a, b, None) => (a - b).abs(),
            },
        };
        distance.is_finite().then_some(distance)
    }
}

/// Over as much of the range as both have.
fn rms_difference(a: &[f64], b: &[f64]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b));
    (squares.sum::<f64>() / a.len().min(b.len()) as f64).sqrt()
}
