//! Percentiles, and their support by samples.

use gyre_contract::run::latency::Durations;
use serde::Serialize;

/// The minimum number of samples for a 99th percentile: one is beyond it.
const LEAST: u64 = 100;
/// The minimum number for a firm one: ten are beyond it.
const FIRM: u64 = 1000;

/// Percentiles of a duration, ms, as far as the number of samples supports them.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Distribution {
    pub samples: u64,
    pub p50_ms: Option<f64>,
    pub p99_ms: Option<f64>,
    pub max_ms: Option<f64>,
}

impl Distribution {
    pub fn of(durations: &Durations) -> Self {
        let samples = durations.count();
        let at = |share: f64| durations.at(share).map(|ns| ns as f64 * 1e-6);
        Self {
            samples,
            p50_ms: at(0.5).filter(|_| samples >= 2),
            p99_ms: at(0.99).filter(|_| samples >= LEAST),
            max_ms: at(1.0),
        }
    }

    /// Returns ` of N` for a 99th percentile of N samples that depends on chance.
    pub fn p99_mark(&self) -> String {
        match self.p99_ms.is_some() && self.samples < FIRM {
            true => format!(" of {}", self.samples),
            false => String::new(),
        }
    }

    /// Returns a percentile to be judged: where there are too few samples for it, the maximum.
    pub fn judged(&self, percentile: Option<f64>) -> Option<f64> {
        percentile.or(self.max_ms)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(a: Option<f64>, b: f64) -> bool {
        a.is_some_and(|a| (a - b).abs() <= 2e-3 * b)
    }

    #[test]
    fn a_percentile_needs_samples_and_one_that_rests_on_few_is_marked() {
        for (samples, p50_ms, p99_ms, judged_ms, mark) in [
            (0, None, None, None, ""),
            (99, Some(50.0), None, Some(99.0), ""),
            (100, Some(50.0), Some(99.0), Some(99.0), " of 100"),
            (1000, Some(500.0), Some(990.0), Some(990.0), ""),
        ] {
            let mut durations = Durations::default();
            (1..=samples).for_each(|ms| durations.add(ms * 1_000_000));
            let of = Distribution::of(&durations);
            let is = |found: Option<f64>, ms: Option<f64>| {
                found == ms || ms.is_some_and(|ms| near(found, ms))
            };
            assert!(is(of.p50_ms, p50_ms) && is(of.p99_ms, p99_ms), "{of:?}");
            assert!(is(of.judged(of.p99_ms), judged_ms), "{of:?}");
            assert_eq!(of.p99_mark(), mark);
        }
    }
}
