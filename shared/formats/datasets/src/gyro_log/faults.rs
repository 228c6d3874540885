//! Faults of the samples of a log, and which samples are left out.

use std::{ops::Range, path::Path};

use super::SampleLog;

use gyre_radar::median;
use serde::Serialize;

use crate::{
    LogError,
    table::{Raw, between, leave_out, longest_chain},
};
use gyre_geometry::samples::{Sample, SampleKind};

/// Rates beyond this one are no vehicle's, rad/s.
const ABSURD_RADPS: f64 = 10.0;
/// If the share of absurd rates is larger, the unit must be different.
pub(crate) const ABSURD_SHARE: f64 = 0.01;
/// Longest time between two samples that is no gap, median periods, whatever stamps round to.
const GAP_PERIODS: f64 = 3.0 + 1e-6;
/// A burst is spread over at most so many times the time that as many samples take otherwise:
/// before a longer one samples were lost.
const MOST_SPREAD: f64 = 2.0;
/// A step of the stamps by more than this, ns, parts stretches; back it is no disorder but a step
/// of the clock.
const STEP_NS: i64 = 1_000_000_000;
/// A step ahead by more than this is no gap but a step of the clock, ns.
const AHEAD_NS: i64 = 3_600_000_000_000;
/// With this many stretches the stamps are not measured by a clock.
const MAX_STRETCHES: usize = 5000;
/// A late sample fills a hole if it is at least so many periods from its neighbours: more than half
/// a period, since one between two others is at most that far from the nearer.
const HOLE_PERIODS: f64 = 0.6;

const SPREAD: &str = "samples come in bursts of one stamp: spread evenly back to the burst before.";
const REPEATED: &str = "samples have the stamp of a different sample: left out.";
const OUT_OF_ORDER: &str = "samples come later than their stamps say: sorted.";
const MEASURED_TWICE: &str = "samples are of times over which the clock was set back, and which have two measurements: left out.";

/// Faults of a log. Its samples do not include the ones counted as left out.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LogFaults {
    /// Rows that do not fit the table, such as a truncated row: left out.
    pub unreadable: usize,
    /// Line (of a folder of files: number) of the first of them.
    pub first_unreadable: usize,
    /// Samples that are stated to have no value, or have one that is not finite: left out.
    pub not_a_number: usize,
    /// Samples with a rate beyond 10 rad/s, or a speed beyond 100 m/s: left out.
    pub absurd: usize,
    /// Samples that come in bursts of one stamp: spread over the time since the burst before.
    pub spread: usize,
    /// Samples with a repeated stamp: left out.
    pub repeated: usize,
    /// Samples with a stamp before an earlier one: sorted.
    pub out_of_order: usize,
    /// Samples of times for which the clock was set back, by up to a second: left out.
    pub measured_twice: usize,
    /// Places where the stamps step back by more than a second, or ahead by more than an hour, s.
    pub clock_steps_s: Vec<f64>,
    /// The number of the sample, from 1, behind which the first of them is.
    pub first_clock_step: usize,
    /// Samples whose stamps such steps make unusable: left out.
    pub by_clock_steps: usize,
    /// Times without samples, of more than three periods.
    pub gaps: Vec<LogGap>,
    /// Samples that are missing one or two at a time: the value is interpolated.
    pub bridged: usize,
    /// The header names no unit: rad/s or m/s is assumed.
    pub unit_is_assumed: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LogGap {
    /// The last sample before it, s since the first of the log.
    pub after_s: f64,
    pub seconds: f64,
}

impl LogFaults {
    /// Returns how the clock steps, and where first: without a full stop.
    pub fn clock_steps(&self) -> String {
        let (count, first) = (self.clock_steps_s.len(), self.first_clock_step);
        let steps = self.clock_steps_s.iter().take(5);
        let steps: Vec<String> = steps.map(|step| format!("{step:+.6} s")).collect();
        let steps = steps.join(", ");
        format!("The clock steps {count} times ({steps}), first behind sample {first}")
    }

    /// Returns a sentence for each kind of fault of the log of a sensor.
    pub fn sentences(&self, of: SampleKind) -> Vec<String> {
        let [values, absurd, unit_of] = match of {
            SampleKind::Gyro => [
                "rates",
                "rates beyond 10 rad/s, at which no vehicle turns",
                "of the rates: rad/s is assumed; `gyre calibrate` tells deg/s by its scale",
            ],
            SampleKind::Wheels => [
                "speeds",
                "speeds beyond 100 m/s, at which no vehicle drives",
                "of the speed: m/s is assumed; `gyre calibrate` tells km/h by its scale",
            ],
        };
        let line = self.first_unreadable;
        let table = format!("rows are not of its table, the first in line {line}: left out.");
        let numbers = format!("samples have no {values}, or some that are not finite: left out.");
        let absurd = format!("samples have {absurd}: left out.");
        let counted = [
            (self.unreadable, table.as_str()),
            (self.not_a_number, numbers.as_str()),
            (self.absurd, absurd.as_str()),
            (self.spread, SPREAD),
            (self.repeated, REPEATED),
            (self.out_of_order, OUT_OF_ORDER),
            (self.measured_twice, MEASURED_TWICE),
        ];
        let counted = counted.into_iter().filter(|(count, _)| *count > 0);
        let counted = counted.map(|(count, sentence)| format!("{count} {sentence}"));
        let steps = (!self.clock_steps_s.is_empty()).then(|| {
            let (steps, count) = (self.clock_steps(), self.by_clock_steps);
            format!("{steps}: {count} samples that do not fit with the others are left out.")
        });
        let longest = self.gaps.iter().copied();
        let longest = longest.max_by(|a, b| a.seconds.total_cmp(&b.seconds));
        let gaps = longest.map(|LogGap { after_s, seconds }| {
            let places = self.gaps.len();
            format!("Samples are missing in {places} places, for up to {seconds:.2} s ({after_s:.1} s after the first).")
        });
        let count = self.bridged;
        let bridged = (count > 0).then(|| {
            format!("{count} samples are missing one or two at a time: interpolated where `max_gap_s` allows it.")
        });
        let unit = format!("The header names no unit {unit_of}.");
        let unit = self.unit_is_assumed.then_some(unit);
        let others = [steps, gaps, bridged, unit].into_iter().flatten();
        counted.chain(others).collect()
    }
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Plausible {
    pub of: SampleKind,
    /// The number of values of a sample that count.
    pub values: usize,
    pub most: f64,
    /// That in words, and the remedy where many are beyond.
    pub beyond: &'static str,
}

pub(super) const RATES: Plausible = Plausible {
    of: SampleKind::Gyro,
    values: 3,
    most: ABSURD_RADPS,
    beyond: "have rates beyond 10 rad/s, at which no vehicle turns: if they are in deg/s, name the columns so, as gyro_z_degps",
};

pub(crate) fn examine(
    raw: Raw<Sample>,
    unit_is_assumed: bool,
    path: &Path,
    plausible: &Plausible,
) -> Result<SampleLog, LogError> {
    let unusable = |reason: String| LogError::unusable(plausible.of.section(), path, reason);
    let mut faults = LogFaults {
        unreadable: raw.unreadable.count,
        first_unreadable: raw.unreadable.first,
        unit_is_assumed,
        ..LogFaults::default()
    };
    if let Some(reason) = raw.unreadable.are_most(raw.count()) {
        return Err(unusable(reason));
    }
    let mut samples = raw.entries;
    let values = |sample: &Sample| sample.values.into_iter().take(plausible.values);
    let left_out = leave_out(&mut samples, |it| {
        values(it).any(|value| !value.is_finite())
    });
    faults.not_a_number = left_out + raw.unmeasured;
    let (finite, most) = (samples.len(), plausible.most);
    let absurd = leave_out(&mut samples, |it| {
        values(it).any(|value| value.abs() > most)
    });
    faults.absurd = absurd;
    if absurd as f64 > ABSURD_SHARE * finite as f64 {
        let beyond = plausible.beyond;
        return Err(unusable(format!(
            "{absurd} of its {finite} samples {beyond}"
        )));
    }
    spread(&mut samples, &mut faults);
    let samples = repair(samples, &mut faults).map_err(unusable)?;
    let samples = sort(&samples, &mut faults);
    if samples.is_empty() {
        return Err(unusable("it has no samples".to_owned()));
    }
    (faults.gaps, faults.bridged) = gaps(&samples);
    Ok(SampleLog {
        samples,
        faults,
        path: path.to_owned(),
    })
}

/// Times without samples, of samples in the order of their stamps, and the number of samples that
/// are missing one or two at a time.
fn gaps(samples: &[Sample]) -> (Vec<LogGap>, usize) {
    let seconds = |from: usize, to: usize| {
        let [from, to] = [from, to].map(|k| samples.get(k).map(|it| it.stamp_ns));
        from.zip(to).map(|(from, to)| (to - from) as f64 * 1e-9)
    };
    let steps = || (0..samples.len()).filter_map(|k| Some((k, seconds(k, k + 1)?)));
    let period_s = median(steps().map(|(_, step_s)| step_s)).unwrap_or_default();
    let (gaps, short): (Vec<_>, Vec<_>) = steps().partition(|it| it.1 > GAP_PERIODS * period_s);
    let missing = |(k, step_s): (usize, f64)| {
        let missing = (step_s / period_s - 1.0).round();
        // A stamp that jitters is as much nearer to the sample on its other side.
        let before = k.checked_sub(1).and_then(|before| seconds(before, k + 1));
        let mut around = before.into_iter().chain(seconds(k, k + 2));
        let is_missing = around.all(|around_s| around_s > (missing + 1.5) * period_s);
        if is_missing { missing as usize } else { 0 }
    };
    let bridged = short.into_iter().map(missing).sum();
    let gaps = gaps.into_iter().map(|(k, step_s)| LogGap {
        after_s: seconds(0, k).unwrap_or_default(),
        seconds: step_s,
    });
    (gaps.collect(), bridged)
}

/// Spreads each burst evenly back to the stamp of the burst before, the first one by the period of
/// the others. A log is one of bursts if more than half of its samples share a stamp, and a tenth
/// of these have different values: rows that were written twice have the same.
fn spread(samples: &mut [Sample], faults: &mut LogFaults) {
    let bursts = || samples.chunk_by(|a, b| a.stamp_ns == b.stamp_ns);
    let count = |is_so: fn(&[Sample]) -> bool| -> usize {
        let bursts = bursts().filter(|burst| burst.len() > 1 && is_so(burst));
        bursts.map(<[Sample]>::len).sum()
    };
    let shared = count(|_| true);
    let different = count(|burst| burst.iter().any(|it| it.values != burst[0].values));
    if 2 * shared <= samples.len() || 10 * different <= shared {
        return;
    }
    let mut before_ns = None;
    let steps = bursts().map(|burst| {
        let since_ns = before_ns.map(|ns| burst[0].stamp_ns.saturating_sub(ns));
        before_ns = Some(burst[0].stamp_ns);
        let step_ns = since_ns.unwrap_or_default() as f64 / burst.len() as f64;
        (burst.len(), step_ns)
    });
    let steps: Vec<(usize, f64)> = steps.collect();
    let forward = steps.iter().map(|(_, step_ns)| *step_ns);
    let period_ns = median(forward.filter(|ns| *ns > 0.0)).unwrap_or_default();
    let mut rest = samples;
    for (count, step_ns) in steps {
        let is_usual = 0.0 < step_ns && step_ns <= MOST_SPREAD * period_ns;
        let step_ns = if is_usual { step_ns } else { period_ns };
        let (burst, others) = rest.split_at_mut(count);
        for (k, sample) in burst.iter_mut().rev().enumerate() {
            let back_ns = (step_ns * k as f64).round() as i64;
            sample.stamp_ns = sample.stamp_ns.saturating_sub(back_ns);
        }
        rest = others;
    }
    faults.spread = shared;
}

/// Keeps those stretches between steps of the stamps that follow one another and have the most
/// samples.
fn repair(samples: Vec<Sample>, faults: &mut LogFaults) -> Result<Vec<Sample>, String> {
    let steps = (1..samples.len()).map(|k| (k, step_ns(&samples, k)));
    let of_clock = || (steps.clone()).filter(|(_, ns)| !(-STEP_NS..=AHEAD_NS).contains(ns));
    faults.clock_steps_s = of_clock().map(|(_, ns)| ns as f64 * 1e-9).collect();
    faults.first_clock_step = of_clock().next().map_or(0, |(k, _)| k);
    if faults.clock_steps_s.is_empty() {
        return Ok(samples);
    }
    let starts = steps.filter(|(_, ns)| ns.abs() > STEP_NS).map(|(k, _)| k);
    let stretches = between(samples.len(), starts);
    let kept = match stretches.len() <= MAX_STRETCHES {
        true => most(&stretches, &samples),
        false => Vec::new(),
    };
    let kept = kept.into_iter().flat_map(|stretch| &samples[stretch]);
    let kept: Vec<Sample> = kept.copied().collect();
    faults.by_clock_steps = samples.len() - kept.len();
    match faults.by_clock_steps > kept.len() {
        true => Err(format!(
            "most of its stamps do not fit with each other. {}. Are the stamps in another column?",
            faults.clock_steps()
        )),
        false => Ok(kept),
    }
}

fn step_ns(samples: &[Sample], k: usize) -> i64 {
    samples[k].stamp_ns - samples[k - 1].stamp_ns
}

fn most(stretches: &[Range<usize>], samples: &[Sample]) -> Vec<Range<usize>> {
    let span = |stretch: &Range<usize>| {
        let stamps = samples[stretch.clone()].iter().map(|it| it.stamp_ns);
        (stamps.clone().min(), stamps.max())
    };
    let spans: Vec<_> = stretches.iter().map(span).collect();
    longest_chain(stretches, MAX_STRETCHES, |earlier, k| {
        spans[earlier].1 < spans[k].0
    })
}

/// Sorts samples by their stamps, and removes repeated stamps.
///
/// A sample that came late fills a hole. Where it does not the clock was set back, and the time
/// since is measured twice: which stamps are right is not known, and none of them is used.
fn sort(samples: &[Sample], faults: &mut LogFaults) -> Vec<Sample> {
    let mut order: Vec<usize> = (0..samples.len()).collect();
    order.sort_by_key(|k| samples[*k].stamp_ns);
    order.dedup_by_key(|k| samples[*k].stamp_ns);
    faults.repeated = samples.len() - order.len();
    let stamp = |place: usize| samples[order[place]].stamp_ns;
    let period_ns = median((1..order.len()).map(|k| (stamp(k) - stamp(k - 1)) as f64));
    let hole_ns = (HOLE_PERIODS * period_ns.unwrap_or_default()) as i64;
    let fills_hole = |place: usize| {
        let before = place.checked_sub(1).map(|k| stamp(place) - stamp(k));
        let after = (place + 1 < order.len()).then(|| stamp(place + 1) - stamp(place));
        before.into_iter().chain(after).all(|ns| ns >= hole_ns)
    };
    let late = late(samples, &order);
    faults.out_of_order = late.iter().flatten().count();
    let twice = late.iter().enumerate().filter_map(|(place, latest)| {
        let latest_ns = (*latest)?;
        (!fills_hole(place)).then(|| (stamp(place), latest_ns))
    });
    // Ordered by their starts, as the places are.
    let mut until_ns = i64::MIN;
    let mut twice = twice.peekable();
    let mut kept = Vec::with_capacity(order.len());
    for sample in order.iter().map(|k| samples[*k]) {
        while let Some((_, end_ns)) = twice.next_if(|(start_ns, _)| *start_ns <= sample.stamp_ns) {
            until_ns = until_ns.max(end_ns);
        }
        if sample.stamp_ns > until_ns {
            kept.push(sample);
        }
    }
    faults.measured_twice = order.len() - kept.len();
    kept
}

/// For each place in the order the latest stamp that was written before, if that is later.
fn late(samples: &[Sample], order: &[usize]) -> Vec<Option<i64>> {
    let mut latest_ns = i64::MIN;
    let mut before = Vec::with_capacity(samples.len());
    for sample in samples {
        before.push(latest_ns);
        latest_ns = latest_ns.max(sample.stamp_ns);
    }
    let of = |k: &usize| (samples[*k].stamp_ns < before[*k]).then_some(before[*k]);
    order.iter().map(of).collect()
}
