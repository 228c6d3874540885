//! Samples that come in bursts, all of a burst with its receive time as stamp.

use gyre_radar::median;

use super::LogFaults;
use gyre_geometry::samples::Sample;

/// A burst is spread over at most so many times the time that as many samples take otherwise:
/// before a longer one samples were lost.
const MOST: f64 = 2.0;

/// Spreads each burst evenly back to the stamp of the burst before, the first one by the period of
/// the others. A log is one of bursts if more than half of its samples share a stamp, and a tenth
/// of these have different values: rows that were written twice have the same.
pub(super) fn spread(samples: &mut [Sample], faults: &mut LogFaults) {
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
        let is_usual = 0.0 < step_ns && step_ns <= MOST * period_ns;
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
