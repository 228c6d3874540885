//! Samples that are not in the order of their stamps.

use gyre_radar::median;

use super::LogFaults;
use gyre_geometry::samples::Sample;

/// A late sample fills a hole if it is at least so many periods from its neighbours: more than half
/// a period, since one between two others is at most that far from the nearer.
const HOLE_PERIODS: f64 = 0.6;

/// Sorts samples by their stamps, and removes repeated stamps.
///
/// A sample that came late fills a hole. Where it does not the clock was set back, and the time
/// since is measured twice: which stamps are right is not known, and none of them is used.
pub(super) fn sort(samples: &[Sample], faults: &mut LogFaults) -> Vec<Sample> {
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
