//! Clocks that were set: stretches of samples whose stamps belong together.

use std::ops::Range;

use super::LogFaults;
use crate::stretches::{between, longest_chain};
use gyre_geometry::samples::Sample;

/// A step of the stamps by more than this, ns, parts stretches; back it is no disorder but a step
/// of the clock.
const STEP_NS: i64 = 1_000_000_000;
/// A step ahead by more than this is no gap but a step of the clock, ns.
const AHEAD_NS: i64 = 3_600_000_000_000;
/// With this many stretches the stamps are not measured by a clock.
const MAX_STRETCHES: usize = 5000;

/// Keeps those stretches between steps of the stamps that follow one another and have the most
/// samples.
pub(super) fn repair(samples: Vec<Sample>, faults: &mut LogFaults) -> Result<Vec<Sample>, String> {
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
