//! From samples of a gyro to the turn between two scans.

use bytemuck::{Pod, Zeroable};
use gyre_geometry::Twist;

use crate::{GyroConfig, Sample, SampleKind};

/// Turn of the radar that is taken for a scan whose azimuths all have the same time, ns.
const MIN_TURN_NS: i64 = 250_000_000;

/// The turn of the sensor from one scan to the next by the gyro, counter-clockwise.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct GyroTurn {
    /// From the stamp of the scan before to that of the scan, rad, with the bias.
    pub yaw_rad: f64,
    /// Variance but for the bias, rad².
    pub variance_rad2: f64,
    /// The time between both, s.
    pub interval_s: f64,
    /// Mean rate during the sweep of the scan, rad/s, with the bias.
    pub sweep_rate_radps: f64,
}

/// Integrates the yaw rate between scans.
///
/// The result for a scan depends on the samples that came with it and with the scan before, and on
/// nothing else: so a process that is restarted at the scan before says the same.
#[derive(Clone, Debug, Default)]
pub struct Gyro {
    config: GyroConfig,
    earlier: Option<Sweep>,
    later: Option<Sweep>,
    /// Of scans that were dropped since the last one.
    dropped: Vec<Rate>,
    turn: Option<GyroTurn>,
}

/// A stamp, ns, and the yaw rate, rad/s.
type Rate = (i64, f64);

/// A scan with what came with it.
#[derive(Clone, Debug, Default)]
struct Sweep {
    stamp_ns: i64,
    /// Times of the first and of the last azimuth.
    span_ns: [i64; 2],
    /// In the order of their stamps.
    rates: Vec<Rate>,
    /// Mean rate during the sweep, rad/s; `None` where samples are missing.
    rate_radps: Option<f64>,
}

impl Gyro {
    /// Creates an integrator without samples.
    pub fn new(config: &GyroConfig) -> Self {
        Self {
            config: config.clone(),
            ..Self::default()
        }
    }

    /// Takes the samples that come with the next scan, in the order of their stamps, and the times
    /// of its stamp and of its first and last azimuth.
    pub fn push(&mut self, samples: &[Sample], stamp_ns: i64, span_ns: [i64; 2]) {
        let mut sweep = self.earlier.take().unwrap_or_default();
        sweep.rates.clear();
        sweep.rates.extend(rates(samples));
        (sweep.stamp_ns, sweep.span_ns) = (stamp_ns, span_ns);
        sweep.rate_radps = sweep.mean_rate(self.max_gap_ns());
        self.earlier = self.later.replace(sweep);
        self.turn = self.integrate();
        self.dropped.clear();
    }

    /// Takes the samples of a scan that is dropped: they count as those of the next one.
    pub fn drop_scan(&mut self, samples: &[Sample]) {
        self.dropped.extend(rates(samples));
    }

    /// Forgets all samples.
    pub fn clear(&mut self) {
        *self = Self::new(&self.config);
    }

    /// Returns the turn from the stamp of the scan before to that of the scan; `None` where samples
    /// are missing.
    pub fn turn(&self) -> Option<GyroTurn> {
        self.turn
    }

    /// Returns the mean rates during the sweeps of the scan before and of the scan, rad/s; `None`
    /// where samples are missing.
    pub fn sweep_rates_radps(&self) -> [Option<f64>; 2] {
        [&self.earlier, &self.later].map(|sweep| sweep.as_ref()?.rate_radps)
    }

    fn integrate(&self) -> Option<GyroTurn> {
        let (before, scan) = (self.earlier.as_ref()?, self.later.as_ref()?);
        let since = before
            .rates
            .iter()
            .filter(|rate| rate.0 >= before.span_ns[0]);
        let mut rates: Vec<Rate> = Vec::with_capacity(before.rates.len() + scan.rates.len());
        for rate in since.chain(&self.dropped).chain(&scan.rates) {
            // A sample can come with two scans.
            let is_later = rates.last().is_none_or(|last| last.0 < rate.0);
            rates.extend(is_later.then_some(*rate));
        }
        let yaw_rad = integral(&rates, [before.stamp_ns, scan.stamp_ns], self.max_gap_ns())?;
        let interval_s = seconds(scan.stamp_ns - before.stamp_ns);
        let change = rate_at(&rates, scan.stamp_ns)? - rate_at(&rates, before.stamp_ns)?;
        let by_scale = self.config.scale_sigma * yaw_rad;
        let by_time = self.config.time_sigma_s * change;
        let walk = self.config.noise_rad_per_sqrt_s.powi(2) * interval_s;
        Some(GyroTurn {
            yaw_rad,
            variance_rad2: walk + by_scale * by_scale + by_time * by_time,
            interval_s,
            sweep_rate_radps: scan.rate_radps?,
        })
    }

    fn max_gap_ns(&self) -> i64 {
        (self.config.max_gap_s * 1e9) as i64
    }
}

impl Sweep {
    /// The mean rate from the first azimuth to the last, by the samples between.
    fn mean_rate(&self, max_gap_ns: i64) -> Option<f64> {
        let [start_ns, end_ns] = self.span_ns;
        let first = self.rates.partition_point(|rate| rate.0 < start_ns);
        let end = self.rates.partition_point(|rate| rate.0 <= end_ns);
        let rates = self.rates.get(first..end)?;
        match start_ns < end_ns {
            true => {
                let turned = integral(rates, self.span_ns, max_gap_ns)?;
                Some(turned / seconds(end_ns - start_ns))
            }
            false => rate_at(&self.rates, end_ns),
        }
    }
}

/// Returns the interval whose samples come with a scan, from the times of its first and its last
/// azimuth: those after the first time and up to the second. It begins a turn before the sweep, so
/// that a scan that cannot be read leaves no hole; a sample then comes with two scans, and counts
/// once.
pub fn interval_of(span_ns: [i64; 2]) -> [i64; 2] {
    let [start_ns, end_ns] = span_ns;
    let turn_ns = end_ns.saturating_sub(start_ns).max(MIN_TURN_NS);
    [start_ns.saturating_sub(turn_ns), end_ns]
}

/// Returns the velocity for the compensation of a sweep: with the gyro's mean rate, if it has one.
pub fn with_yaw_rate(twist: Option<Twist>, rate_radps: Option<f64>) -> Option<Twist> {
    twist.map(|twist| Twist {
        yaw_rate_radps: rate_radps.unwrap_or(twist.yaw_rate_radps),
        ..twist
    })
}

fn rates(samples: &[Sample]) -> impl Iterator<Item = Rate> {
    let gyro = samples.iter().filter(|sample| sample.is(SampleKind::Gyro));
    gyro.map(|sample| (sample.stamp_ns, sample.values[2]))
}

/// The integral of the rate, interpolated linearly; `None` if two samples are farther apart than
/// that, or an end is farther from the nearest one.
fn integral(rates: &[Rate], [from_ns, to_ns]: [i64; 2], max_gap_ns: i64) -> Option<f64> {
    if from_ns >= to_ns {
        return None;
    }
    let first = rates.partition_point(|(stamp_ns, _)| *stamp_ns <= from_ns);
    let end = rates.partition_point(|(stamp_ns, _)| *stamp_ns < to_ns);
    let inside = rates.get(first..end)?.iter().copied();
    let (mut sum, mut before) = (0.0, (from_ns, rate_at(rates, from_ns)?));
    for next in inside.chain([(to_ns, rate_at(rates, to_ns)?)]) {
        sum += 0.5 * (before.1 + next.1) * seconds(next.0 - before.0);
        before = next;
    }
    let around = &rates[first.saturating_sub(1)..rates.len().min(end + 1)];
    let is_near = |sample: Option<&Rate>, at_ns: i64| {
        sample.is_some_and(|(stamp_ns, _)| (stamp_ns - at_ns).abs() <= max_gap_ns)
    };
    let is_dense = around
        .windows(2)
        .all(|pair| pair[1].0 - pair[0].0 <= max_gap_ns);
    let covers = is_near(around.first(), from_ns) && is_near(around.last(), to_ns);
    (is_dense && covers).then_some(sum)
}

/// The rate at a time, interpolated linearly; before the first sample and after the last, that of
/// the nearest.
fn rate_at(rates: &[Rate], stamp_ns: i64) -> Option<f64> {
    let next = rates.partition_point(|(at_ns, _)| *at_ns < stamp_ns);
    let after = rates.get(next).or(rates.last())?;
    let before = rates.get(next.saturating_sub(1))?;
    if after.0 <= before.0 {
        return Some(after.1);
    }
    let share = seconds(stamp_ns - before.0) / seconds(after.0 - before.0);
    Some(before.1 + (after.1 - before.1) * share.clamp(0.0, 1.0))
}

fn seconds(ns: i64) -> f64 {
    ns as f64 * 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const MS: i64 = 1_000_000;
    const SWEEP: i64 = 250 * MS;

    /// The samples of sweep after sweep of 250 ms, each stamped in its middle.
    fn gyro(first_sweep: i64, scans: &[&[Rate]]) -> Gyro {
        let mut gyro = Gyro::new(&GyroConfig::default());
        for (k, rates) in (first_sweep..).zip(scans) {
            gyro.push(
                &samples(rates),
                k * SWEEP + SWEEP / 2,
                [k * SWEEP, (k + 1) * SWEEP],
            );
        }
        gyro
    }

    fn samples(rates: &[Rate]) -> Vec<Sample> {
        let sample = |(ms, rate): &Rate| Sample::yaw_rate(ms * MS, *rate);
        rates.iter().map(sample).collect()
    }

    /// Samples of a rate that grows evenly, from one time to another, ms.
    fn ramp(from: i64, to: i64, every: usize) -> Vec<Rate> {
        let stamps = (from..=to).step_by(every);
        stamps.map(|ms| (ms, 1e-3 * ms as f64)).collect()
    }

    proptest! {
        /// A rate that grows evenly is integrated exactly, whatever the stamps of the samples.
        #[test]
        fn the_turn_is_the_integral_of_the_rate(first in 0i64..100, every in 1usize..100) {
            let all = ramp(first, 501, every);
            let (before, after) = all.split_at(all.partition_point(|(ms, _)| *ms <= 250));
            let turn = gyro(0, &[before, after]).turn().unwrap_or_default();
            prop_assert!((turn.yaw_rad - 0.25 * 0.25).abs() < 1e-9, "{turn:?}");
            // At the ends of a sweep the nearest sample holds.
            let off = turn.sweep_rate_radps - 0.375;
            prop_assert!(off.abs() < 1e-3 * every as f64, "{turn:?}");
            prop_assert_eq!(turn.interval_s, 0.25);
        }
    }

    #[test]
    fn a_process_that_starts_at_the_scan_before_says_the_same() {
        let scans = [0, 250, 500].map(|from| ramp(from + 3, from + 250, 7));
        let whole = gyro(0, &[&scans[0], &scans[1], &scans[2]]);
        let late = gyro(1, &[&scans[1], &scans[2]]);
        assert!(whole.turn().is_some());
        assert_eq!(whole.turn(), late.turn());
        let alone = gyro(2, &[&scans[2]]);
        assert_eq!(alone.turn(), None);
        assert_eq!(whole.sweep_rates_radps()[1], alone.sweep_rates_radps()[1]);
    }

    #[test]
    fn nothing_is_made_up_where_samples_are_missing() {
        let all = ramp(0, 500, 10);
        let turn_without = |lost: std::ops::Range<i64>| {
            let kept = all.iter().filter(|(ms, _)| !lost.contains(ms));
            let (before, after): (Vec<_>, Vec<_>) = kept.partition(|(ms, _)| *ms <= 250);
            gyro(0, &[&before, &after]).turn()
        };
        assert!(turn_without(0..0).is_some() && turn_without(200..300).is_some());
        for lost in [200..330, 0..250, 370..501, 0..501] {
            assert_eq!(turn_without(lost.clone()), None, "{lost:?}");
        }
    }

    #[test]
    fn samples_of_a_dropped_scan_are_those_of_the_next_one() {
        let [first, second, third] = [0, 250, 500].map(|from| ramp(from + 1, from + 250, 10));
        let mut live = gyro(0, &[&first]);
        live.drop_scan(&samples(&second));
        live.push(&samples(&third), 625 * MS, [500 * MS, 750 * MS]);
        let turn = live.turn().unwrap_or_default();
        assert!((turn.yaw_rad - 0.5 * 0.375).abs() < 1e-3, "{turn:?}");
        let mut replayed = gyro(0, &[&first]);
        let both: Vec<Rate> = second.iter().chain(&third).copied().collect();
        replayed.push(&samples(&both), 625 * MS, [500 * MS, 750 * MS]);
        assert_eq!(Some(turn), replayed.turn());
        assert_eq!(live.sweep_rates_radps(), replayed.sweep_rates_radps());
    }
}
