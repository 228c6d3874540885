//! The delay of a gyro or of wheels against the radar, from the motions of a run.

use gyre_geometry::samples::Sample;
use gyre_radar::median;

use crate::{
    Estimate,
    gyro::{angles::Angles, fit::Fit, search, turns::turns},
};

/// The turn or the distance from one scan to the next, by the radar alone and by another sensor.
#[derive(Clone, Copy, Debug)]
pub struct Compared {
    pub stamp_ns: i64,
    pub interval_ns: i64,
    /// By the radar, rad or m; `None` where it does not measure it.
    pub radar: Option<f64>,
    /// By the other sensor; `None` where it does not.
    pub other: Option<f64>,
}

/// Estimates the delay of the stamps of the other sensor, s: the smallest delay that fits the
/// measurements about as well as the best one. `None` where they do not determine it. Speeds have
/// no bias: `has_bias` is for rates.
pub fn delay(motions: &[Compared], has_bias: bool) -> Option<Estimate> {
    let first_ns = motions.first()?.stamp_ns;
    let stamps: Vec<i64> = motions.iter().map(|it| it.stamp_ns).collect();
    let steps: Vec<f64> = motions.iter().map(|it| it.radar.unwrap_or(0.0)).collect();
    let starts: Vec<bool> = motions.iter().map(|it| it.radar.is_none()).collect();
    let sample = |it: &Compared| {
        let rate = it.other? / (it.interval_ns as f64 * 1e-9);
        let middle_ns = it.stamp_ns - it.interval_ns / 2;
        rate.is_finite().then(|| Sample::yaw_rate(middle_ns, rate))
    };
    let samples: Vec<Sample> = motions.iter().filter_map(sample).collect();
    let interval_s = median(motions.iter().map(|it| it.interval_ns as f64 * 1e-9))?;
    let log = Angles::new(&samples, first_ns, 1.5 * interval_s);
    let turns = turns(&stamps, &steps, &starts);
    let peak = search::nearest(&turns, &log)?;
    let [_, _, delay_s] = Fit::new(&turns, &log, &peak, has_bias)?.parameters;
    // By the turns that a search finds right gyros are up to 0.4 of an interval late.
    Some(delay_s.with_error(0.2 * interval_s))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The delay of a sensor whose measurements are so late and scaled, beside a radar with noise,
    /// over 40 s with these rates.
    fn found(rate: fn(f64) -> f64, delay_s: f64, scale: f64) -> Option<Estimate> {
        let over = |s: f64| {
            (0..25)
                .map(|k| 0.01 * rate(s - 0.01 * f64::from(k)))
                .sum::<f64>()
        };
        let motion = |k: i32| {
            let by_radar = over(0.25 * f64::from(k)) + 2e-3 * (2.4 * f64::from(k)).sin();
            Compared {
                stamp_ns: i64::from(k) * 250_000_000,
                interval_ns: 250_000_000,
                radar: (k % 40 != 0).then_some(by_radar),
                other: Some(scale * over(0.25 * f64::from(k) - delay_s)),
            }
        };
        delay(&(0..160).map(motion).collect::<Vec<_>>(), true)
    }

    #[test]
    fn a_delay_is_measured_and_none_is_made_up() {
        let winding = |s: f64| 0.055 * (0.314 * s).cos();
        let town = |s: f64| 0.2 * (0.4 * s).sin().powi(9) + 0.1 * (0.23 * s + 1.0).sin().powi(5);
        for (delay_s, scale) in [(-2.0, 1.0), (0.0, 0.8), (0.3, 1.3), (1.6, 1.0)] {
            for found in [winding, town].map(|rate| found(rate, delay_s, scale).unwrap()) {
                let off = (found.value - delay_s).abs() / found.sigma;
                assert!(off < 4.0 && found.sigma < 0.07, "{delay_s} s: {found:?}");
            }
        }
        assert_eq!(found(|_| 0.0, 1.0, 1.0), None, "a straight road");
        assert_eq!(found(town, 0.0, -1.0), None, "another axis");
    }
}
