//! Latency from the completion of a scan to its pose, hop by hop.

use std::collections::BTreeMap;

use gyre_messages::{Hop, PoseHeader, StageId};
use serde::Serialize;

/// Percentiles of a duration, microseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Percentiles {
    /// Median, us.
    pub p50_us: f64,
    /// 90th percentile, us.
    pub p90_us: f64,
    /// 99th percentile, us.
    pub p99_us: f64,
    /// Maximum, us.
    pub max_us: f64,
}

/// The latency of one stage.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct HopLatency {
    /// From the publication by the stage before to the reception.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transport: Option<Percentiles>,
    /// From the reception to the start of the work.
    pub wait: Percentiles,
    /// Duration of the work.
    pub work: Percentiles,
    /// Share of the time that the stage worked.
    pub busy: f64,
}

/// The latency of a run: `latency.json`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Latency {
    /// Scans counted.
    pub scans: usize,
    /// From the completion of the sweep (its last azimuth's time) to the journalled pose.
    pub sensor_to_pose: Percentiles,
    /// Stage by stage.
    pub stages: BTreeMap<&'static str, HopLatency>,
    /// Share of the time that two or more stages worked at once.
    pub overlap: f64,
    /// The stage that works the largest share of the time.
    pub bound_by: Option<&'static str>,
}

impl Percentiles {
    fn of(durations_ns: impl Iterator<Item = i64>) -> Self {
        let mut sorted: Vec<i64> = durations_ns.collect();
        sorted.sort_unstable();
        let at = |share: f64| match sorted.len() {
            0 => 0.0,
            n => sorted[((n as f64 * share).ceil() as usize).clamp(1, n) - 1] as f64 * 1e-3,
        };
        Self {
            p50_us: at(0.5),
            p90_us: at(0.9),
            p99_us: at(0.99),
            max_us: at(1.0),
        }
    }
}

impl Latency {
    /// Computes it from the stamps of the poses.
    pub fn of(poses: &[PoseHeader]) -> Self {
        let finished =
            |pose: &PoseHeader| pose.item.hops[StageId::PoseIntegration as usize].finished_ns;
        let span_ns = span(poses);
        let stages = hops(poses, span_ns);
        let busiest = stages.iter().max_by(|a, b| a.1.busy.total_cmp(&b.1.busy));
        Self {
            scans: poses.len(),
            sensor_to_pose: Percentiles::of(
                poses.iter().map(|pose| finished(pose) - pose.item.due_ns),
            ),
            bound_by: busiest.map(|(name, _)| *name),
            overlap: overlap(poses, span_ns),
            stages,
        }
    }
}

/// The hops of the stages that the run has: those of the others are zero.
fn hops(poses: &[PoseHeader], span_ns: i64) -> BTreeMap<&'static str, HopLatency> {
    let passed = |stage: &StageId| {
        poses
            .iter()
            .any(|pose| pose.item.hops[*stage as usize] != Hop::default())
    };
    let mut before = None;
    let mut stages = BTreeMap::new();
    for stage in StageId::ALL.into_iter().filter(passed) {
        stages.insert(stage.name(), hop(poses, before, stage, span_ns));
        before = Some(stage);
    }
    stages
}

fn hop(poses: &[PoseHeader], before: Option<StageId>, stage: StageId, span_ns: i64) -> HopLatency {
    let hops = || poses.iter().map(move |pose| pose.item.hops[stage as usize]);
    let transport = before.map(|before| {
        let crossing = |pose: &PoseHeader| {
            pose.item.hops[stage as usize].received_ns
                - pose.item.hops[before as usize].published_ns
        };
        Percentiles::of(poses.iter().map(crossing))
    });
    let busy_ns: i64 = hops().map(|hop| hop.finished_ns - hop.started_ns).sum();
    HopLatency {
        transport,
        wait: Percentiles::of(hops().map(|hop| hop.started_ns - hop.received_ns)),
        work: Percentiles::of(hops().map(|hop| hop.finished_ns - hop.started_ns)),
        busy: busy_ns as f64 / span_ns.max(1) as f64,
    }
}

/// Time from the start of the first work to the end of the last.
fn span(poses: &[PoseHeader]) -> i64 {
    let first = poses.iter().map(|pose| pose.item.hops[0].started_ns).min();
    let last = poses
        .iter()
        .map(|pose| pose.item.hops[StageId::PoseIntegration as usize].finished_ns)
        .max();
    last.unwrap_or(0) - first.unwrap_or(0)
}

fn overlap(poses: &[PoseHeader], span_ns: i64) -> f64 {
    let hops = poses.iter().flat_map(|pose| pose.item.hops);
    let mut edges: Vec<(i64, i32)> = hops
        .flat_map(|hop| [(hop.started_ns, 1), (hop.finished_ns, -1)])
        .collect();
    edges.sort_unstable();
    let (mut busy, mut since, mut together) = (0, 0, 0);
    for (at, change) in edges {
        if busy >= 2 {
            together += at - since;
        }
        busy += change;
        since = at;
    }
    together as f64 / span_ns.max(1) as f64
}

#[cfg(test)]
mod tests {
    use gyre_messages::{Hop, Item};

    use super::*;

    fn pose(due_ns: i64) -> PoseHeader {
        let hop = |k: i64| {
            let received_ns = due_ns + k * 10_000;
            Hop {
                received_ns,
                started_ns: received_ns + 1000,
                finished_ns: received_ns + 6000,
                published_ns: received_ns + 7000,
            }
        };
        let hops = [
            hop(0),
            hop(1),
            hop(2),
            hop(3),
            Hop::default(),
            Hop::default(),
            hop(4),
        ];
        PoseHeader {
            item: Item {
                due_ns,
                hops,
                ..Item::default()
            },
            ..PoseHeader::default()
        }
    }

    #[test]
    fn each_hop_is_measured() {
        let latency = Latency::of(&[pose(0), pose(1_000_000)]);
        let masking = &latency.stages["masking"];
        assert_eq!(masking.transport.map(|t| t.p50_us), Some(3.0));
        assert_eq!((masking.wait.max_us, masking.work.p99_us), (1.0, 5.0));
        assert_eq!(latency.sensor_to_pose.p50_us, 46.0);
        assert_eq!(latency.overlap, 0.0);
    }

    #[test]
    fn scans_a_hop_apart_keep_two_stages_busy_at_once() {
        let latency = Latency::of(&[pose(0), pose(10_000)]);
        assert!(
            (latency.overlap - 4.0 * 5.0 / 55.0).abs() < 1e-9,
            "{}",
            latency.overlap
        );
    }

    #[test]
    fn percentiles_of_nothing_are_zero() {
        assert_eq!(Latency::of(&[]).sensor_to_pose, Percentiles::default());
    }
}
