//! From samples of a gyro to the turn between two scans.

use crate::{GyroConfig, Sample, SampleKind};

/// What the gyro says of the turn of the sensor from one scan to the next, counter-clockwise.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GyroTurn {
    /// From the stamp of the scan before to that of the scan, rad, with the bias.
    pub yaw_rad: f64,
    /// Its variance but for the bias, rad².
    pub variance_rad2: f64,
    /// The time between both, s.
    pub interval_s: f64,
    /// Mean rate during the sweep of the scan, rad/s, with the bias.
    pub sweep_rate_radps: f64,
}

/// Integrates the yaw rate between scans.
///
/// It keeps the samples of the last two scans, and nothing else: so a process that is restarted at
/// the scan before finds the same turn.
#[derive(Clone, Debug, Default)]
pub struct Gyro {
    config: GyroConfig,
    rates: Rates,
    /// Number of rates that the scan before has.
    earlier: usize,
}

/// Rates in the order of their stamps.
#[derive(Clone, Debug, Default)]
struct Rates(Vec<(i64, f64)>);

impl Gyro {
    /// Creates an integrator without samples.
    pub fn new(config: &GyroConfig) -> Self {
        Self {
            config: config.clone(),
            ..Self::default()
        }
    }

    /// Takes the samples of the next scan. Those of the scan before the last are forgotten.
    pub fn push(&mut self, samples: &[Sample]) {
        self.rates.0.drain(..self.earlier);
        self.earlier = self.rates.0.len();
        self.extend(samples);
    }

    /// Takes more samples of the same scan: those of a scan that was dropped.
    pub fn extend(&mut self, samples: &[Sample]) {
        let gyro = samples.iter().filter(|sample| sample.is(SampleKind::Gyro));
        let rates = gyro.map(|sample| (sample.stamp_ns, sample.values[2]));
        self.rates.0.extend(rates);
    }

    /// Forgets all samples.
    pub fn clear(&mut self) {
        self.rates.0.clear();
        self.earlier = 0;
    }

    /// Integrates the rate from the stamp of the scan before to that of the scan, and over the
    /// scan's sweep; `None` where samples are missing.
    pub fn turn(&self, [from_ns, to_ns]: [i64; 2], sweep_ns: [i64; 2]) -> Option<GyroTurn> {
        let max_gap_ns = (self.config.max_gap_s * 1e9) as i64;
        let integral = |span| self.rates.integral(span, max_gap_ns);
        let yaw_rad = integral([from_ns, to_ns])?;
        let interval_s = seconds(to_ns - from_ns);
        let change = self.rates.at(to_ns)? - self.rates.at(from_ns)?;
        let by_scale = self.config.scale_sigma * yaw_rad;
        let by_time = self.config.time_sigma_s * change;
        let walk = self.config.noise_rad_per_sqrt_s.powi(2) * interval_s;
        Some(GyroTurn {
            yaw_rad,
            variance_rad2: walk + by_scale * by_scale + by_time * by_time,
            interval_s,
            sweep_rate_radps: match sweep_ns[0] < sweep_ns[1] {
                true => integral(sweep_ns)? / seconds(sweep_ns[1] - sweep_ns[0]),
                false => self.rates.at(to_ns)?,
            },
        })
    }
}

impl Rates {
    /// The integral of the rate, interpolated linearly; `None` if two samples are farther apart, or
    /// an end is farther from the nearest one.
    fn integral(&self, [from_ns, to_ns]: [i64; 2], max_gap_ns: i64) -> Option<f64> {
        if from_ns >= to_ns {
            return None;
        }
        let first = self.0.partition_point(|(stamp_ns, _)| *stamp_ns <= from_ns);
        let end = self.0.partition_point(|(stamp_ns, _)| *stamp_ns < to_ns);
        let mut before = (from_ns, self.at(from_ns)?);
        let inside = self.0.get(first..end)?.iter().copied();
        let mut sum = 0.0;
        for next in inside.chain([(to_ns, self.at(to_ns)?)]) {
            sum += 0.5 * (before.1 + next.1) * seconds(next.0 - before.0);
            before = next;
        }
        let around = self
            .0
            .get(first.saturating_sub(1)..self.0.len().min(end + 1))?;
        let is_near = |sample: Option<&(i64, f64)>, at_ns: i64| {
            sample.is_some_and(|(stamp_ns, _)| (stamp_ns - at_ns).abs() <= max_gap_ns)
        };
        let is_dense = around
            .windows(2)
            .all(|pair| pair[1].0 - pair[0].0 <= max_gap_ns);
        let covers = is_near(around.first(), from_ns) && is_near(around.last(), to_ns);
        (is_dense && covers).then_some(sum)
    }

    /// The rate at a time, interpolated linearly; before the first sample and after the last, that
    /// of the nearest.
    fn at(&self, stamp_ns: i64) -> Option<f64> {
        let next = self.0.partition_point(|(at_ns, _)| *at_ns < stamp_ns);
        let after = self.0.get(next).or(self.0.last())?;
        let before = self.0.get(next.saturating_sub(1))?;
        if after.0 <= before.0 {
            return Some(after.1);
        }
        let share = seconds(stamp_ns - before.0) / seconds(after.0 - before.0);
        Some(before.1 + (after.1 - before.1) * share.clamp(0.0, 1.0))
    }
}

fn seconds(ns: i64) -> f64 {
    ns as f64 * 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const MS: i64 = 1_000_000;

    fn gyro(samples: &[&[(i64, f64)]]) -> Gyro {
        let mut gyro = Gyro::new(&GyroConfig::default());
        for samples in samples {
            let samples = samples
                .iter()
                .map(|(ms, rate)| Sample::yaw_rate(ms * MS, *rate));
            gyro.push(&samples.collect::<Vec<_>>());
        }
        gyro
    }

    /// Samples of a rate that grows evenly, from one time to another, ms.
    fn ramp(from: i64, to: i64, every: i64) -> Vec<(i64, f64)> {
        let stamps = (from..to).step_by(every as usize);
        stamps.map(|ms| (ms, 1e-3 * ms as f64)).collect()
    }

    fn turn(gyro: &Gyro) -> Option<GyroTurn> {
        gyro.turn([125 * MS, 375 * MS], [250 * MS, 500 * MS])
    }

    proptest! {
        /// A rate that grows evenly is integrated exactly, whatever the stamps of the samples.
        #[test]
        fn the_turn_is_the_integral_of_the_rate(first in 0i64..20, every in 1i64..100) {
            let samples = ramp(first, 501, every);
            let [before, after] = [true, false].map(|before| {
                let of_scan = |(ms, _): &&(i64, f64)| (*ms <= 250) == before;
                samples.iter().filter(of_scan).copied().collect::<Vec<_>>()
            });
            let turn = gyro(&[&before, &after]).turn([125 * MS, 375 * MS], [250 * MS, 400 * MS]);
            let turn = turn.unwrap_or_default();
            prop_assert!((turn.yaw_rad - 0.25 * 0.25).abs() < 1e-9, "{turn:?}");
            prop_assert!((turn.sweep_rate_radps - 0.325).abs() < 1e-9, "{turn:?}");
            prop_assert_eq!(turn.interval_s, 0.25);
        }
    }

    #[test]
    fn a_process_that_starts_at_the_scan_before_finds_the_same_turn() {
        let scans = [0, 250, 500].map(|from| ramp(from - 250, from, 7));
        let whole = gyro(&[&scans[0], &scans[1], &scans[2]]);
        let late = gyro(&[&scans[1], &scans[2]]);
        assert!(turn(&whole).is_some());
        assert_eq!(turn(&whole), turn(&late));
    }

    #[test]
    fn nothing_is_made_up_where_samples_are_missing() {
        let all = ramp(0, 501, 10);
        let without = |lost: std::ops::Range<i64>| -> Vec<_> {
            let kept = all.iter().filter(|(ms, _)| !lost.contains(ms));
            kept.copied().collect()
        };
        let is_known = |samples: &[(i64, f64)]| turn(&gyro(&[samples])).is_some();
        assert!(is_known(&all) && is_known(&without(200..300)));
        for lost in [200..330, 0..250, 370..501, 0..501] {
            assert!(!is_known(&without(lost.clone())), "{lost:?}");
        }
    }

    #[test]
    fn samples_of_a_dropped_scan_are_those_of_the_next_one() {
        let (first, second) = (ramp(0, 250, 10), ramp(250, 501, 10));
        let mut dropped = gyro(&[&[], &first]);
        let more = second
            .iter()
            .map(|(ms, rate)| Sample::yaw_rate(ms * MS, *rate));
        dropped.extend(&more.collect::<Vec<_>>());
        assert_eq!(turn(&dropped), turn(&gyro(&[&first, &second])));
    }
}
