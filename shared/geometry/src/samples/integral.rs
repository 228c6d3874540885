use crate::samples::{Sample, SampleKind};

/// Turn of the radar assumed for a scan whose azimuths all have the same time, ns.
const MIN_TURN_NS: i64 = 250_000_000;

/// Integrates a rate between scans: a value of the samples of one kind.
///
/// The result for a scan depends only on the samples that came with it and with the scan before, so
/// a process that is restarted at the scan before returns the same result.
#[derive(Clone, Debug)]
pub struct Integrator<C> {
    pub(crate) config: C,
    kind: SampleKind,
    value: usize,
    /// Longest time between two samples over which the rate is interpolated.
    max_gap_ns: i64,
    earlier: Option<Sweep>,
    later: Option<Sweep>,
    /// Of scans that were dropped since the last one.
    dropped: Vec<Rate>,
    /// From the stamp of the scan before to the stamp of the scan; `None` where samples are
    /// missing.
    pub(crate) integral: Option<Integral>,
}

/// The integral of a rate from the stamp of one scan to the stamp of the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Integral {
    pub sum: f64,
    /// From the rate at the first stamp to that at the second.
    pub change: f64,
    pub interval_s: f64,
}

/// A stamp, ns, and the rate.
type Rate = (i64, f64);

#[derive(Clone, Debug, Default)]
struct Sweep {
    stamp_ns: i64,
    /// Times of the first and of the last azimuth.
    span_ns: [i64; 2],
    rates: Vec<Rate>,
    /// Mean rate during the sweep; `None` where samples are missing.
    mean: Option<f64>,
}

impl<C> Integrator<C> {
    pub(crate) fn of(config: C, kind: SampleKind, value: usize, max_gap_s: f64) -> Self {
        Self {
            config,
            kind,
            value,
            max_gap_ns: (max_gap_s * 1e9) as i64,
            earlier: None,
            later: None,
            dropped: Vec::new(),
            integral: None,
        }
    }

    /// Takes the samples that come with the next scan, in the order of their stamps, and the times
    /// of its stamp and of its first and last azimuth.
    pub fn push(&mut self, samples: &[Sample], stamp_ns: i64, span_ns: [i64; 2]) {
        let mut sweep = self.earlier.take().unwrap_or_default();
        sweep.rates.clear();
        sweep.rates.extend(rates(samples, self.kind, self.value));
        (sweep.stamp_ns, sweep.span_ns) = (stamp_ns, span_ns);
        sweep.mean = sweep.mean(self.max_gap_ns);
        self.earlier = self.later.replace(sweep);
        self.integral = self.integrate();
        self.dropped.clear();
    }

    /// Takes the samples of a dropped scan: they count as samples of the next scan.
    pub fn drop_scan(&mut self, samples: &[Sample]) {
        let rates = rates(samples, self.kind, self.value);
        self.dropped.extend(rates);
    }

    pub fn clear(&mut self) {
        self.dropped.clear();
        (self.earlier, self.later, self.integral) = (None, None, None);
    }

    /// Returns the mean rates during the sweeps of the scan before and of the scan; `None` where
    /// samples are missing.
    pub(crate) fn means(&self) -> [Option<f64>; 2] {
        [&self.earlier, &self.later].map(|sweep| sweep.as_ref()?.mean)
    }

    fn integrate(&self) -> Option<Integral> {
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
        Some(Integral {
            sum: integral(&rates, [before.stamp_ns, scan.stamp_ns], self.max_gap_ns)?,
            change: rate_at(&rates, scan.stamp_ns)? - rate_at(&rates, before.stamp_ns)?,
            interval_s: seconds(scan.stamp_ns - before.stamp_ns),
        })
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

fn rates(samples: &[Sample], kind: SampleKind, value: usize) -> impl Iterator<Item = Rate> {
    let of_kind = samples.iter().filter(move |sample| sample.is(kind));
    of_kind.map(move |sample| (sample.stamp_ns, sample.values[value]))
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

fn seconds(ns: i64) -> f64 {
    ns as f64 * 1e-9
}
