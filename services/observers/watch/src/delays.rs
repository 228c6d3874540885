//! Delays of the last minute.

use gyre_contract::{Item, StageId};
use serde_json::{Value, json};

const WINDOW_NS: i64 = 60_000_000_000;
/// Width of a step of the time series.
const STEP_NS: i64 = 1_000_000_000;

/// Returns the percentiles of the poses of the last minute, ms: of sensor to pose, and of each
/// stage the hand-over, from the publication by the stage before to the start of the work, and the
/// work.
pub fn report<'a>(items: impl Iterator<Item = &'a Item>, now_ns: i64) -> Value {
    let items = items.filter(|item| finished_ns(item) >= now_ns - WINDOW_NS);
    let items: Vec<&Item> = items.collect();
    let mut of_stages = StageId::ALL.map(|_| (Vec::new(), Vec::new()));
    for times in items.iter().flat_map(|item| item.hop_times()) {
        let (hand_over, work) = &mut of_stages[times.stage as usize];
        hand_over.push(times.transport_ns.unwrap_or(0) + times.wait_ns);
        work.push(times.work_ns);
    }
    let percentiles = |delays_ns: Vec<i64>| {
        let [p50_ms, p99_ms] = at(delays_ns, [0.5, 0.99])?;
        Some(json!({"p50_ms": p50_ms, "p99_ms": p99_ms}))
    };
    let stages = StageId::ALL.into_iter().zip(of_stages);
    let stages = stages.filter_map(|(stage, (hand_over, work))| {
        let (hand_over, work) = (percentiles(hand_over)?, percentiles(work)?);
        Some(json!({"stage": stage.name(), "hand_over": hand_over, "work": work}))
    });
    let sensor_to_pose = items.iter().map(|item| item.sensor_to_pose_ns());
    let none = || json!({"p50_ms": 0.0, "p99_ms": 0.0});
    json!({
        "samples": items.len(),
        "sensor_to_pose": percentiles(sensor_to_pose.collect()).unwrap_or_else(none),
        "stages": stages.collect::<Vec<_>>(),
        "series": series(&items, now_ns),
    })
}

/// Returns median and maximum of sensor to pose in each second, oldest first: a second has too few
/// poses for a percentile beyond. The last second is not over, and is left out.
fn series(items: &[&Item], now_ns: i64) -> Vec<Option<Value>> {
    let steps = WINDOW_NS / STEP_NS;
    let mut of_step = vec![Vec::new(); steps as usize];
    let end = now_ns / STEP_NS;
    for item in items {
        let step = finished_ns(item) / STEP_NS - (end - steps);
        if (0..steps).contains(&step) {
            of_step[step as usize].push(item.sensor_to_pose_ns());
        }
    }
    let second = |delays_ns| {
        let [p50_ms, max_ms] = at(delays_ns, [0.5, 1.0])?;
        Some(json!({"p50_ms": p50_ms, "max_ms": max_ms}))
    };
    of_step.into_iter().map(second).collect()
}

/// Returns the end of the last work on an item.
fn finished_ns(item: &Item) -> i64 {
    item.hops[StageId::PoseIntegration as usize].finished_ns
}

/// Returns the values at these shares of their order, ms; `None` of no values.
fn at(mut delays_ns: Vec<i64>, shares: [f64; 2]) -> Option<[f64; 2]> {
    let last = delays_ns.len().checked_sub(1)? as f64;
    delays_ns.sort_unstable();
    let delay_ns = |share: f64| delays_ns[(last * share).round() as usize].max(0);
    Some(shares.map(|share| delay_ns(share) as f64 / 1e6))
}

#[cfg(test)]
mod tests {
    use gyre_contract::Hop;

    use super::*;

    /// Returns a pose whose sweep was complete so many ms before `at_ns`.
    fn pose(at_ns: i64, delay_ms: i64) -> Item {
        let mut item = Item {
            due_ns: at_ns - delay_ms * 1_000_000,
            ..Item::default()
        };
        let hop = |received_ns: i64| Hop {
            received_ns,
            started_ns: received_ns + 100_000,
            finished_ns: received_ns + 600_000,
            published_ns: received_ns + 700_000,
        };
        *item.hop_mut(StageId::Masking) = hop(at_ns - 2_000_000);
        *item.hop_mut(StageId::PoseIntegration) = hop(at_ns - 600_000);
        item
    }

    #[test]
    fn delays_are_those_of_the_last_minute() {
        let now_ns = 200 * STEP_NS + STEP_NS / 2;
        let mut items = vec![pose(now_ns - WINDOW_NS - 1, 900)];
        items.extend((1..=50).map(|second| pose(now_ns - second * STEP_NS, second)));
        let found = report(items.iter(), now_ns);
        assert_eq!(found["samples"], 50);
        assert_eq!(found["sensor_to_pose"]["p99_ms"], 50.0);
        let seconds_of = |report: &Value| report["series"].as_array().cloned().unwrap_or_default();
        let seconds = seconds_of(&found);
        let seen = seconds.iter().filter(|second| !second.is_null());
        assert_eq!((seconds.len(), seen.count()), (60, 50));
        assert_eq!(seconds[59], json!({"p50_ms": 1.0, "max_ms": 1.0}));
        let later = report(items.iter(), now_ns + 2 * WINDOW_NS);
        assert_eq!(later["samples"], 0);
        assert_eq!(seconds_of(&later), vec![Value::Null; 60]);
    }

    #[test]
    fn each_stage_of_the_run_has_its_hand_over_and_its_work() {
        let found = report([pose(STEP_NS, 5)].iter(), STEP_NS);
        let [first, second] = [0_usize, 1].map(|index| &found["stages"][index]);
        assert_eq!(
            [&first["stage"], &second["stage"]],
            ["masking", "pose-integration"]
        );
        assert_eq!(found["stages"][2], Value::Null);
        // Published 0.7 ms after its receipt at -2 ms, received at -0.6 ms, begun 0.1 ms later.
        assert_eq!(second["hand_over"]["p50_ms"], 0.8);
        assert_eq!(second["work"]["p50_ms"], 0.5);
    }
}
