//! Samples of a rate or a speed that are left out, and the order of their stamps.

use std::ops::Range;

use gyre_geometry::samples::Sample;
use gyre_radar::median;

use super::table::{between, leave_out, longest_chain};
use super::{LogFaults, LogGap, kinds::Kind};

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

/// Leaves out samples that no vehicle measures, and puts the stamps of the others in order.
pub(super) fn repaired(
    mut samples: Vec<Sample>,
    kind: &Kind,
    faults: &mut LogFaults,
) -> Result<Vec<Sample>, String> {
    let (finite, values) = (samples.len(), kind.values);
    faults.absurd = leave_out(&mut samples, |it| {
        it.values
            .iter()
            .take(values)
            .any(|value| value.abs() > kind.most)
    });
    let absurd = faults.absurd;
    if absurd as f64 > ABSURD_SHARE * finite as f64 {
        return Err(format!("{absurd} of its {finite} samples {}", kind.beyond));
    }
    spread(&mut samples, faults);
    let samples = repair(samples, faults)?;
    let samples = sort(&samples, faults);
    if samples.is_empty() {
        return Err("it has no samples".to_owned());
    }
    (faults.gaps, faults.bridged) = gaps(&samples);
    Ok(samples)
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
