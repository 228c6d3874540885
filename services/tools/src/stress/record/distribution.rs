//! Percentiles, and their support by samples.

use gyre_run::latency::Durations;
use serde::Serialize;

/// The minimum number of samples beyond a firm percentile.
const FIRM: f64 = 10.0;

/// Percentiles of a duration, ms, as far as the number of samples supports them: the share q needs
/// 1 / (1 - q) samples.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Distribution {
    pub samples: u64,
    pub p50_ms: Option<f64>,
    pub p90_ms: Option<f64>,
    pub p99_ms: Option<f64>,
    pub p99_9_ms: Option<f64>,
    pub p99_99_ms: Option<f64>,
    pub max_ms: Option<f64>,
}

impl Distribution {
    pub fn of(durations: &Durations) -> Self {
        let samples = durations.count();
        let at = |share: f64| durations.at(share).map(|ns| ns as f64 * 1e-6);
        // Rounded: 1 - 0.99 is not 0.01.
        let is_supported = |share: f64| samples >= (1.0 / (1.0 - share)).round() as u64;
        let supported = |share| at(share).filter(|_| is_supported(share));
        Self {
            samples,
            p50_ms: supported(0.5),
            p90_ms: supported(0.9),
            p99_ms: supported(0.99),
            p99_9_ms: supported(0.999),
            p99_99_ms: supported(0.9999),
            max_ms: at(1.0),
        }
    }

    /// Returns ` of N` for the percentile of a share with fewer than ten of the N samples beyond
    /// it: it depends on chance.
    pub fn mark(&self, percentile: Option<f64>, share: f64) -> String {
        let beyond = (self.samples as f64 * (1.0 - share)).round();
        match percentile.is_some() && beyond < FIRM {
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
    fn percentiles_need_samples() {
        let mut durations = Durations::default();
        (1..=100).for_each(|ms| durations.add(ms * 1_000_000));
        let of = Distribution::of(&durations);
        assert!(near(of.p50_ms, 50.0) && near(of.p99_ms, 99.0));
        assert_eq!((of.p99_9_ms, of.p99_99_ms), (None, None));
        assert!(near(of.judged(of.p99_9_ms), 100.0));
        assert_eq!(Distribution::of(&Durations::default()).p50_ms, None);
    }

    #[test]
    fn a_percentile_that_rests_on_few_samples_is_marked() {
        for (samples, percentile, share, mark) in [
            (480, Some(7.0), 0.99, " of 480"),
            (480, None, 0.999, ""),
            (480, Some(4.5), 0.5, ""),
            (1000, Some(7.0), 0.99, ""),
        ] {
            let of = Distribution {
                samples,
                ..Distribution::default()
            };
            assert_eq!(of.mark(percentile, share), mark);
        }
    }
}
