//! The quantities to compare: turns or distances of a second, by the radar and by the log of a
//! sensor.

use gyre_geometry::samples::Sample;
use gyre_radar::median;
use nalgebra::Vector3;

/// Duration of a stretch, s: longer than a scan, to average the noise of motions.
pub(super) const BASELINE_S: f64 = 1.0;

/// A stretch of the radar's track.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stretch {
    /// Start and end, s since the first scan.
    pub(super) from_s: f64,
    pub(super) to_s: f64,
    /// The angle, counter-clockwise, rad; or the distance ahead, m.
    pub(super) amount: f64,
}

/// A stamp (ns), and the turn or distance since the stamp before by the radar; `None` where it does
/// not measure it.
pub(super) type Step = (i64, Option<f64>);

/// The stretches from each scan to the first that is [`BASELINE_S`] later.
pub(super) fn stretches(steps: &[Step]) -> Vec<Stretch> {
    let since = |k: usize| (steps[k].0 - steps[0].0) as f64 * 1e-9;
    let stretch = |from: usize| {
        let wanted_s = since(from) + BASELINE_S - 1e-3;
        let to = (from..steps.len()).find(|to| since(*to) >= wanted_s)?;
        let amounts = steps[from + 1..=to].iter().map(|step| step.1);
        Some(Stretch {
            from_s: since(from),
            to_s: since(to),
            amount: amounts.sum::<Option<f64>>()?,
        })
    };
    (0..steps.len()).filter_map(stretch).collect()
}

/// The integrals of the first three values of a log, s since the first scan on the log's own clock.
pub(super) struct Log {
    stamps_s: Vec<f64>,
    rates: Vec<Vector3<f64>>,
    /// Integrals since the first sample, and gaps.
    amounts: Vec<Vector3<f64>>,
    gaps: Vec<usize>,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Logged {
    /// By axis: angles about x, y and z, rad; or the distance, m.
    pub(super) amount: Vector3<f64>,
    /// The rates at the end less those at the start: the change of the amounts by a later time.
    pub(super) by_late: Vector3<f64>,
}

impl Log {
    pub(super) fn new(samples: &[Sample], first_ns: i64, max_gap_s: f64) -> Self {
        let samples = samples.iter();
        let seconds = |ns: i64| (i128::from(ns) - i128::from(first_ns)) as f64 * 1e-9;
        let stamps_s: Vec<f64> = samples.clone().map(|it| seconds(it.stamp_ns)).collect();
        let rates: Vec<_> = samples
            .map(|it| Vector3::new(it.values[0], it.values[1], it.values[2]))
            .collect();
        let (mut amount, mut gap) = (Vector3::zeros(), 0);
        let (mut amounts, mut gaps) = (vec![amount], vec![gap]);
        for k in 1..rates.len() {
            let step_s = stamps_s[k] - stamps_s[k - 1];
            amount += 0.5 * step_s * (rates[k] + rates[k - 1]);
            gap += usize::from(step_s > max_gap_s);
            amounts.push(amount);
            gaps.push(gap);
        }
        Self {
            stamps_s,
            rates,
            amounts,
            gaps,
        }
    }

    /// Returns the median time between samples, s.
    pub(super) fn period_s(&self) -> f64 {
        let steps = self.stamps_s.windows(2).map(|pair| pair[1] - pair[0]);
        median(steps).unwrap_or_default()
    }

    pub(super) fn begins_s(&self) -> Option<f64> {
        self.stamps_s.first().copied()
    }

    /// Integrates over a stretch whose stamps in the log are so late; `None` where samples are
    /// missing.
    pub(super) fn over(&self, stretch: &Stretch, delay_s: f64) -> Option<Logged> {
        let [from_s, to_s] = [stretch.from_s, stretch.to_s].map(|it| it + delay_s);
        let [(first, from), (last, to)] = [self.at(from_s)?, self.at(to_s)?];
        let has_gap = self.gaps[last + 1] > self.gaps[first];
        (!has_gap).then(|| Logged {
            amount: to.amount - from.amount,
            by_late: to.by_late - from.by_late,
        })
    }

    /// The sample before a time, with the amounts and the rates at it; `None` outside of the log.
    fn at(&self, time_s: f64) -> Option<(usize, Logged)> {
        let after = self.stamps_s.partition_point(|stamp_s| *stamp_s <= time_s);
        let before = after.checked_sub(1)?;
        let next_s = self.stamps_s.get(after)?;
        let since_s = time_s - self.stamps_s[before];
        let share = since_s / (next_s - self.stamps_s[before]);
        let rate = self.rates[before].lerp(&self.rates[after], share);
        let turned = Logged {
            amount: self.amounts[before] + 0.5 * since_s * (self.rates[before] + rate),
            by_late: rate,
        };
        Some((before, turned))
    }
}
