//! Delays of the last minute.

use std::collections::VecDeque;

use gyre_messages::{Item, StageId};
use serde_json::{Value, json};

const WINDOW_NS: i64 = 60_000_000_000;
/// Width of a step of the time series.
const STEP_NS: i64 = 1_000_000_000;
/// The most samples: above 136 poses a second the window is shorter than a minute.
const MAX_SAMPLES: usize = 8192;
/// Delays of a pose: sensor to pose, then hand-over and work of each stage.
const KINDS: usize = 1 + 2 * StageId::ALL.len();

#[derive(Debug, Default)]
pub struct Delays {
    samples: VecDeque<DelaySample>,
}

#[derive(Clone, Copy, Debug)]
struct DelaySample {
    /// The end of the last work, `CLOCK_MONOTONIC`.
    at_ns: i64,
    /// In us; `None` where the run has no such stage.
    delays_us: [Option<u32>; KINDS],
}

impl Delays {
    pub fn add(&mut self, item: &Item) {
        let mut delays_us = [None; KINDS];
        delays_us[0] = Some(in_us(item.sensor_to_pose_ns()));
        for times in item.hop_times() {
            let [hand_over, work] = kinds(times.stage);
            let waited_ns = times.transport_ns.unwrap_or(0) + times.wait_ns;
            delays_us[hand_over] = Some(in_us(waited_ns));
            delays_us[work] = Some(in_us(times.work_ns));
        }
        let at_ns = item.hops[StageId::PoseIntegration as usize].finished_ns;
        self.samples.push_back(DelaySample { at_ns, delays_us });
        if self.samples.len() > MAX_SAMPLES {
            self.samples.pop_front();
        }
    }

    /// Removes samples older than a minute, and returns the percentiles of the rest, ms: of sensor to
    /// pose, and of each stage the hand-over, from the publication by the stage before to the start
    /// of the work, and the work.
    pub fn report(&mut self, now_ns: i64) -> Value {
        let is_old = |sample: &DelaySample| sample.at_ns < now_ns - WINDOW_NS;
        while self.samples.front().is_some_and(is_old) {
            self.samples.pop_front();
        }
        let of_kind = |kind: usize| {
            let delays = self.samples.iter().filter_map(|it| it.delays_us[kind]);
            let [p50_ms, p99_ms] = at(delays.collect(), [0.5, 0.99])?;
            Some(json!({"p50_ms": p50_ms, "p99_ms": p99_ms}))
        };
        let stages = StageId::ALL.into_iter().filter_map(|stage| {
            let [hand_over, work] = kinds(stage).map(of_kind);
            Some(json!({"stage": stage.name(), "hand_over": hand_over?, "work": work?}))
        });
        json!({
            "samples": self.samples.len(),
            "sensor_to_pose": of_kind(0).unwrap_or(json!({"p50_ms": 0.0, "p99_ms": 0.0})),
            "stages": stages.collect::<Vec<_>>(),
            "series": self.series(now_ns),
        })
    }

    /// Returns median and maximum of sensor to pose in each second, oldest first: a second has too
    /// few poses for a percentile beyond. The last second is not over, and is left out.
    fn series(&self, now_ns: i64) -> Vec<Option<Value>> {
        let steps = WINDOW_NS / STEP_NS;
        let mut of_step = vec![Vec::new(); steps as usize];
        let end = now_ns / STEP_NS;
        for sample in &self.samples {
            let step = sample.at_ns / STEP_NS - (end - steps);
            if (0..steps).contains(&step) {
                of_step[step as usize].extend(sample.delays_us[0]);
            }
        }
        let second = |delays_us| {
            let [p50_ms, max_ms] = at(delays_us, [0.5, 1.0])?;
            Some(json!({"p50_ms": p50_ms, "max_ms": max_ms}))
        };
        of_step.into_iter().map(second).collect()
    }
}

fn kinds(stage: StageId) -> [usize; 2] {
    let first = 1 + 2 * stage as usize;
    [first, first + 1]
}

fn in_us(duration_ns: i64) -> u32 {
    (duration_ns / 1000).clamp(0, u32::MAX.into()) as u32
}

/// Returns the values at these shares of their order, ms; `None` of no values.
fn at(mut delays_us: Vec<u32>, shares: [f64; 2]) -> Option<[f64; 2]> {
    let last = delays_us.len().checked_sub(1)? as f64;
    delays_us.sort_unstable();
    Some(shares.map(|share| f64::from(delays_us[(last * share).round() as usize]) * 1e-3))
}

#[cfg(test)]
mod tests {
    use gyre_messages::Hop;

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
        let mut delays = Delays::default();
        let now_ns = 200 * STEP_NS + STEP_NS / 2;
        delays.add(&pose(now_ns - WINDOW_NS - 1, 900));
        for second in 1..=50 {
            delays.add(&pose(now_ns - second * STEP_NS, second));
        }
        let report = delays.report(now_ns);
        assert_eq!(report["samples"], 50);
        assert_eq!(report["sensor_to_pose"]["p99_ms"], 50.0);
        let series = |report: &Value| report["series"].as_array().cloned().unwrap_or_default();
        let seconds = series(&report);
        let seen = seconds.iter().filter(|second| !second.is_null());
        assert_eq!((seconds.len(), seen.count()), (60, 50));
        assert_eq!(seconds[59], json!({"p50_ms": 1.0, "max_ms": 1.0}));
        let later = delays.report(now_ns + 2 * WINDOW_NS);
        assert_eq!(later["samples"], 0);
        assert_eq!(series(&later), vec![Value::Null; 60]);
        (0..10_000).for_each(|k| delays.add(&pose(k * 1_000_000, 1)));
        assert_eq!(delays.report(10_000_000_000)["samples"], MAX_SAMPLES);
    }

    #[test]
    fn each_stage_of_the_run_has_its_hand_over_and_its_work() {
        let mut delays = Delays::default();
        delays.add(&pose(STEP_NS, 5));
        let report = delays.report(STEP_NS);
        let [first, second] = [0, 1].map(|index| &report["stages"][index]);
        assert_eq!(
            [&first["stage"], &second["stage"]],
            ["masking", "pose-integration"]
        );
        assert_eq!(report["stages"][2], Value::Null);
        // Published 0.7 ms after its receipt at -2 ms, received at -0.6 ms, begun 0.1 ms later.
        assert_eq!(second["hand_over"]["p50_ms"], 0.8);
        assert_eq!(second["work"]["p50_ms"], 0.5);
    }
}
