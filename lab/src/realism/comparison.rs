//! Distances between two recordings, statistic by statistic.
//!
//! Lengths, shares and errors are compared by the magnitude of the natural logarithm of their
//! ratio: 0.1 is a tenth more or less, 0.69 twice or half.

use gyre_terminal::Failure;
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::{statistics::Statistics, subject::Measured};
use crate::report::{Column, Record, Table, record};

const COLUMNS: [Column; 10] = [
    ("statistic", "statistic", 0),
    ("sim", "sim", 0),
    ("real", "real", 0),
    ("other", "other", 0),
    ("distance", "distance", 0),
    ("within_real", "within real", 3),
    ("sim_real", "sim-real", 3),
    ("real_other", "real-other", 3),
    ("within_other", "within other", 3),
    ("verdict", "sim is", 0),
];

#[derive(Debug, Deserialize)]
struct Rows {
    statistic: Vec<Statistic>,
}

/// A row of `rows/realism.toml`.
#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Statistic {
    name: String,
    distance: Distance,
    figure: String,
    unit: String,
    factor: Option<f64>,
    decimals: Option<usize>,
    floor: f64,
}

/// A distance between two recordings.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize)]
enum Distance {
    #[default]
    #[serde(rename = "abs. log ratio")]
    LogRatio,
    #[serde(rename = "abs. difference")]
    Difference,
    #[serde(rename = "Wasserstein, counts")]
    Wasserstein,
    #[serde(rename = "RMS, counts")]
    Rms,
}

/// Compares `sim` with `real`, and `real` with another real recording: a row a statistic.
pub fn compare(
    sim: &Measured,
    real: &Measured,
    other: Option<&Measured>,
) -> Result<Table, Failure> {
    let statistics = toml::from_str::<Rows>(include_str!("../../rows/realism.toml"))?.statistic;
    let rows = statistics.iter().map(|row| row.compare(sim, real, other));
    let rows: Vec<Record> = rows.collect();
    let judged = rows.iter().filter_map(|row| row.get("closer")?.as_bool());
    let judged: Vec<bool> = judged.collect();
    let closer = judged.iter().filter(|closer| **closer).count();
    let verdict = format!("\n\ncloser in {closer} of {}", judged.len());
    Ok(Table {
        title: "Distances".to_owned(),
        columns: COLUMNS.to_vec(),
        rows,
        legend: other.map(|_| verdict).unwrap_or_default(),
        ..Table::default()
    })
}

impl Statistic {
    fn compare(&self, sim: &Measured, real: &Measured, other: Option<&Measured>) -> Record {
        let within = |measured: &Measured| {
            let [first, second] = measured.halves.as_ref()?;
            self.between(first, second)
        };
        let sim_real = self.between(&sim.whole, &real.whole);
        let real_other = other.and_then(|other| self.between(&real.whole, &other.whole));
        let (within_real, within_other) = (within(real), other.and_then(within));
        let closer = sim_real.zip(real_other).map(|(sim, other)| sim < other);
        // Two real recordings may be closer than halves of one are to each other, by chance.
        let chance = within_real.into_iter().chain(within_other).reduce(f64::max);
        let by_chance = sim_real
            .zip(chance)
            .is_some_and(|(sim, chance)| sim <= chance);
        let verdict = closer.map(|closer| match (closer, by_chance) {
            (true, _) => "closer",
            (false, true) => "farther, within chance",
            (false, false) => "farther",
        });
        record(json!({
            "statistic": self.name,
            "sim": self.shown(&sim.whole),
            "real": self.shown(&real.whole),
            "other": other.and_then(|other| self.shown(&other.whole)),
            "distance": self.distance,
            "within_real": within_real,
            "sim_real": sim_real,
            "real_other": real_other,
            "within_other": within_other,
            "closer": closer,
            "verdict": verdict,
        }))
    }

    fn shown(&self, statistics: &Statistics) -> Option<String> {
        match self.distance {
            Distance::Wasserstein => {
                let percentile = |share| statistics.histogram.percentile(share);
                let [median, high, top] = [0.5, 0.9, 0.99].map(percentile);
                Some(format!("50 %: {median}, 90 %: {high}, 99 %: {top}"))
            }
            Distance::Rms => Some(format!("10 m: {:.1}", statistics.figure("power_at_10_m")?)),
            Distance::LogRatio | Distance::Difference => {
                let value = statistics.figure(&self.figure)? * self.factor.unwrap_or(1.0);
                let decimals = self.decimals.unwrap_or(3);
                Some(format!("{value:.decimals$}{}", self.unit))
            }
        }
    }

    /// `None` where a recording lacks the statistic, or the distance is not finite.
    fn between(&self, a: &Statistics, b: &Statistics) -> Option<f64> {
        let figures = || Some((a.figure(&self.figure)?, b.figure(&self.figure)?));
        let distance = match self.distance {
            Distance::Wasserstein => a.histogram.wasserstein(&b.histogram),
            Distance::Rms => rms_difference(&a.mean_power, &b.mean_power),
            Distance::Difference => figures().map(|(a, b)| (a - b).abs())?,
            Distance::LogRatio => {
                figures().map(|(a, b)| ((a + self.floor) / (b + self.floor)).ln().abs())?
            }
        };
        distance.is_finite().then_some(distance)
    }
}

/// Over as much of the range as both have.
fn rms_difference(a: &[f64], b: &[f64]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b));
    (squares.sum::<f64>() / a.len().min(b.len()) as f64).sqrt()
}
