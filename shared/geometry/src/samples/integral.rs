use crate::samples::{Sample, SampleKind, SensorConfig};

/// Turn of the radar assumed for a scan whose azimuths all have the same time, ns.
const MIN_TURN_NS: i64 = 250_000_000;

/// Integrates a rate between scans: a value of the samples of one kind.
///
/// The result for a scan depends only on the samples that came with it and with the scan before, so
/// a process that is restarted at the scan before returns the same result.
#[derive(Clone, Debug)]
pub struct Integrator {
    of: SampleKind,
    /// Longest time between two samples over which the rate is interpolated.
    max_gap_ns: i64,
    earlier: Option<Sweep>,
    later: Option<Sweep>,
    /// Of scans that were dropped since the last one.
    dropped: Vec<Rate>,
    /// From the first azimuth of the scan before to the last one of the scan.
    pub(crate) rates: Vec<Rate>,
    /// From the stamp of the scan before to the stamp of the scan; `None` where samples are
    /// missing.
    pub(crate) integral: Option<Integral>,
}

/// The integral of a rate from the stamp of one scan to the stamp of the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Integral {
    pub sum: f64,
    /// From the rate at the first stamp to the rate at the second.
    pub change: f64,
    pub interval_s: f64,
    pub samples: u64,
}

/// A stamp, ns, and the rate.
pub(crate) type Rate = (i64, f64);

#[derive(Clone, Debug, Default)]
struct Sweep {
    stamp_ns: i64,
    /// Times of the first and of the last azimuth.
    span_ns: [i64; 2],
    rates: Vec<Rate>,
    /// Mean rate during the sweep; `None` where samples are missing.
    mean: Option<f64>,
}

impl Integral {
    /// Integrates rates between two times; `None` where samples are missing.
    pub(crate) fn of(rates: &[Rate], stamps_ns: [i64; 2], max_gap_ns: i64) -> Option<Self> {
        Some(Self {
            sum: integral(rates, stamps_ns, max_gap_ns)?,
            change: rate_at(rates, stamps_ns[1])? - rate_at(rates, stamps_ns[0])?,
            interval_s: seconds(stamps_ns[1] - stamps_ns[0]),
            samples: rates.len() as u64,
        })
    }
}

impl Integrator {
    pub fn new(config: &dyn SensorConfig) -> Self {
        Self {
            of: config.of(),
            max_gap_ns: (config.max_gap_s() * 1e9) as i64,
            earlier: None,
            later: None,
            dropped: Vec::new(),
            rates: Vec::new(),
            integral: None,
        }
    }

    /// Takes the samples that come with the next scan, in the order of their stamps, and the times
    /// of its stamp and of its first and last azimuth.
    pub fn push(&mut self, samples: &[Sample], stamp_ns: i64, span_ns: [i64; 2]) {
        let mut sweep = self.earlier.take().unwrap_or_default();
        sweep.rates.clear();
        sweep.rates.extend(rates(samples, self.of));
        (sweep.stamp_ns, sweep.span_ns) = (stamp_ns, span_ns);
        sweep.mean = sweep.mean(self.max_gap_ns);
        self.earlier = self.later.replace(sweep);
        self.integral = self.integrate();
        self.dropped.clear();
    }

    /// Takes the samples of a dropped scan: they count as samples of the next scan.
    pub fn drop_scan(&mut self, samples: &[Sample]) {
        let rates = rates(samples, self.of);
        self.dropped.extend(rates);
    }

    pub fn clear(&mut self) {
        self.dropped.clear();
        self.rates.clear();
        (self.earlier, self.later, self.integral) = (None, None, None);
    }

    /// Returns the mean rates during the sweeps of the scan before and of the scan; `None` where
    /// samples are missing.
    pub(crate) fn means(&self) -> [Option<f64>; 2] {
        [&self.earlier, &self.later].map(|sweep| sweep.as_ref()?.mean)
    }

    /// The stamp of the scan, ns.
    pub(crate) fn stamp_ns(&self) -> Option<i64> {
        self.later.as_ref().map(|scan| scan.stamp_ns)
    }

    fn integrate(&mut self) -> Option<Integral> {
        self.rates.clear();
        let (before, scan) = (self.earlier.as_ref()?, self.later.as_ref()?);
        let since = before
            .rates
            .iter()
            .filter(|rate| rate.0 >= before.span_ns[0]);
        let rates = &mut self.rates;
        for rate in since.chain(&self.dropped).chain(&scan.rates) {
            // A sample can come with two scans.
            let is_later = rates.last().is_none_or(|last| last.0 < rate.0);
            rates.extend(is_later.then_some(*rate));
        }
        Integral::of(
            &self.rates,
            [before.stamp_ns, self.stamp_ns()?],
            self.max_gap_ns,
        )
    }
}

impl Sweep {
    /// The mean rate from the first azimuth to the last, by the samples between.
    fn mean(&self, max_gap_ns: i64) -> Option<f64> {
        let [start_ns, end_ns] = self.span_ns;
        let first = self.rates.partition_point(|rate| rate.0 < start_ns);
        let end = self.rates.partition_point(|rate| rate.0 <= end_ns);
        let rates = self.rates.get(first..end)?;
        match start_ns < end_ns {
            true => {
                let sum = integral(rates, self.span_ns, max_gap_ns)?;
                Some(sum / seconds(end_ns - start_ns))
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

pub(super) fn rates(samples: &[Sample], kind: SampleKind) -> impl Iterator<Item = Rate> {
    let of_kind = samples.iter().filter(move |sample| sample.is(kind));
    of_kind.map(move |sample| (sample.stamp_ns, sample.values[kind.rate()]))
}

/// The rate at a time, interpolated linearly; before the first sample and after the last, the
/// nearest rate.
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

pub(super) fn seconds(ns: i64) -> f64 {
    ns as f64 * 1e-9
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::samples::{Evidence, GyroConfig, WheelsConfig};

    const MS: i64 = 1_000_000;
    const SWEEP: i64 = 250 * MS;

    /// Of sweep after sweep of 250 ms, each stamped in its middle.
    fn of(config: &dyn SensorConfig, first_sweep: i64, scans: &[&[Rate]]) -> Integrator {
        let mut rates = Integrator::new(config);
        for (k, of_scan) in (first_sweep..).zip(scans) {
            let span_ns = [k * SWEEP, (k + 1) * SWEEP];
            rates.push(&samples(rates.of, of_scan), k * SWEEP + SWEEP / 2, span_ns);
        }
        rates
    }

    fn turn(first_sweep: i64, scans: &[&[Rate]]) -> Option<Evidence> {
        let config = GyroConfig::default();
        config.measure(&of(&config, first_sweep, scans))
    }

    /// The samples of these rates, with samples of all other kinds between them.
    fn samples(of: SampleKind, rates: &[Rate]) -> Vec<Sample> {
        let sample = |(ns, rate): &Rate| {
            SampleKind::ALL.map(|kind| {
                let value = if kind == of { *rate } else { 9.0 };
                Sample::of(kind, *ns, [value; 6])
            })
        };
        rates.iter().flat_map(sample).collect()
    }

    /// Samples of a rate that grows evenly, from one time to another, ms.
    fn ramp(from: i64, to: i64, every: usize) -> Vec<Rate> {
        let stamps = (from..=to).step_by(every);
        stamps.map(|ms| (ms * MS, 1e-3 * ms as f64)).collect()
    }

    fn split(all: &[Rate]) -> [&[Rate]; 2] {
        let (before, after) = all.split_at(all.partition_point(|(ns, _)| *ns <= 250 * MS));
        [before, after]
    }

    proptest! {
        /// A rate that grows evenly is integrated exactly, whatever the stamps of the samples.
        #[test]
        fn a_turn_and_a_distance_are_the_integrals_of_their_rates(
            first in 0i64..100, every in 1usize..100, times in -30.0..30.0f64,
        ) {
            let all = ramp(first, 501, every);
            let turn = turn(0, &split(&all)).unwrap_or_default();
            prop_assert!((turn.value[0] - 0.25 * 0.25).abs() < 1e-9, "{turn:?}");
            // At the ends of a sweep the nearest sample holds.
            let off = turn.value[1] - 0.375;
            prop_assert!(off.abs() < 1e-3 * every as f64, "{turn:?}");
            prop_assert_eq!(turn.interval_s, 0.25);
            let driven: Vec<Rate> = all.iter().map(|(ns, rate)| (*ns, times * rate)).collect();
            let config = WheelsConfig::default();
            let distance = config.measure(&of(&config, 0, &split(&driven))).unwrap_or_default();
            prop_assert!((distance.value[0] - times * 0.25 * 0.25).abs() < 1e-9, "{distance:?}");
            let least = config.noise_m_per_sqrt_m.powi(2) * distance.value[0].abs();
            prop_assert!(distance.covariance[0] > least && distance.covariance[2] == least);
        }
    }

    #[test]
    fn a_process_that_starts_at_the_scan_before_says_the_same() {
        let scans = [0, 250, 500].map(|from| ramp(from + 3, from + 250, 7));
        let config = GyroConfig::default();
        let from = |first: usize| {
            let scans: Vec<&[Rate]> = scans[first..].iter().map(Vec::as_slice).collect();
            let rates = of(&config, first as i64, &scans);
            (config.measure(&rates), rates.means()[1])
        };
        let [whole, late, alone] = [0, 1, 2].map(from);
        assert!(whole.0.is_some());
        assert_eq!(whole, late);
        assert_eq!(alone, (None, whole.1));
    }

    #[test]
    fn nothing_is_made_up_where_samples_are_missing() {
        let all = ramp(0, 500, 10);
        let turn_without = |lost: std::ops::Range<i64>| {
            let is_kept = |(ns, _): &Rate| !lost.contains(&(ns / MS));
            let kept: Vec<Rate> = all.iter().copied().filter(is_kept).collect();
            turn(0, &split(&kept))
        };
        assert!(turn_without(0..0).is_some() && turn_without(200..300).is_some());
        for lost in [200..330, 0..250, 370..501, 0..501] {
            assert_eq!(turn_without(lost.clone()), None, "{lost:?}");
        }
    }

    #[test]
    fn samples_of_a_dropped_scan_are_those_of_the_next_one() {
        let [first, second, third] = [0, 250, 500].map(|from| ramp(from + 1, from + 250, 10));
        let after_first = |dropped: &[Rate], next: &[Rate]| {
            let mut wheels = of(&WheelsConfig::default(), 0, &[&first]);
            wheels.drop_scan(&samples(SampleKind::Wheels, dropped));
            let span_ns = [500 * MS, 750 * MS];
            wheels.push(&samples(SampleKind::Wheels, next), 625 * MS, span_ns);
            (wheels.integral, wheels.means())
        };
        let live = after_first(&second, &third);
        let driven = live.0.map_or(0.0, |integral| integral.sum);
        assert!((driven - 0.5 * 0.375).abs() < 1e-3, "{driven}");
        assert_eq!(live, after_first(&[], &[second, third].concat()));
    }
}
