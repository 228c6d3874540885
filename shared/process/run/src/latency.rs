//! Latency from the completion of a scan to its pose, hop by hop.

mod durations;
mod overlap;

use std::collections::BTreeMap;

use gyre_messages::{PoseHeader, StageId};
use serde::Serialize;

pub use durations::Durations;
use overlap::Overlap;

/// Percentiles of a duration, microseconds; exact to 0.1 %.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Percentiles {
    pub p50_us: f64,
    pub p90_us: f64,
    pub p99_us: f64,
    pub max_us: f64,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct HopLatency {
    /// From the publication by the stage before to the reception.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transport: Option<Percentiles>,
    /// From the reception to the start of the work.
    pub wait: Percentiles,
    pub work: Percentiles,
    /// Share of the time that the stage worked.
    pub busy: f64,
}

/// The latency of a run: `latency.json`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Latency {
    pub scans: usize,
    /// From the completion of the sweep (its last azimuth's time) to the journalled pose.
    pub sensor_to_pose: Percentiles,
    pub stages: BTreeMap<&'static str, HopLatency>,
    /// Share of the time that two or more stages worked at once.
    pub overlap: f64,
    /// The stage that works the largest share of the time.
    pub bound_by: Option<&'static str>,
}

/// Measures the latency of a run pose by pose, in memory that does not grow with their number.
#[derive(Debug, Default)]
pub struct LatencyMeter {
    scans: usize,
    sensor_to_pose: Durations,
    stages: [HopMeter; StageId::ALL.len()],
    span: Option<(i64, i64)>,
    overlap: Overlap,
}

#[derive(Debug, Default)]
pub struct HopMeter {
    /// From the publication by the stage before to the reception; empty of the first stage.
    pub transport: Durations,
    /// From the reception to the start of the work.
    pub wait: Durations,
    pub work: Durations,
    busy_ns: i64,
}

impl LatencyMeter {
    pub fn add(&mut self, pose: &PoseHeader) {
        let hops = &pose.item.hops;
        let (source, sink) = (hops[0], hops[StageId::PoseIntegration as usize]);
        self.scans += 1;
        self.sensor_to_pose.add(pose.item.sensor_to_pose_ns());
        for times in pose.item.hop_times() {
            let meter = &mut self.stages[times.stage as usize];
            if let Some(transport_ns) = times.transport_ns {
                meter.transport.add(transport_ns);
            }
            meter.wait.add(times.wait_ns);
            meter.work.add(times.work_ns);
            meter.busy_ns += times.work_ns;
        }
        let (first, last) = self.span.unwrap_or((i64::MAX, i64::MIN));
        self.span = Some((first.min(source.started_ns), last.max(sink.finished_ns)));
        self.overlap.add(hops);
    }

    /// Returns the durations of each stage that the run has, in the order of the stream.
    pub fn stages(&self) -> impl Iterator<Item = (StageId, &HopMeter)> {
        let stages = StageId::ALL.into_iter().zip(&self.stages);
        stages.filter(|(_, meter)| meter.work.count() > 0)
    }

    pub fn latency(self) -> Latency {
        let span_ns = self.span.map_or(0, |(first, last)| last - first).max(1) as f64;
        let hop = |meter: &HopMeter| HopLatency {
            transport: meter.transport.percentiles_if_any(),
            wait: meter.wait.percentiles(),
            work: meter.work.percentiles(),
            busy: meter.busy_ns as f64 / span_ns,
        };
        let stages: BTreeMap<_, _> = self
            .stages()
            .map(|(stage, meter)| (stage.name(), hop(meter)))
            .collect();
        let busiest = stages.iter().max_by(|a, b| a.1.busy.total_cmp(&b.1.busy));
        Latency {
            scans: self.scans,
            sensor_to_pose: self.sensor_to_pose.percentiles(),
            bound_by: busiest.map(|(name, _)| *name),
            overlap: self.overlap.together_ns() as f64 / span_ns,
            stages,
        }
    }
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
        let mut hops = [0, 1, 2, 3, 0, 0, 4].map(hop);
        hops[4..6].fill(Hop::default());
        PoseHeader {
            item: Item {
                due_ns,
                hops,
                ..Item::default()
            },
            ..PoseHeader::default()
        }
    }

    fn measured(poses: &[PoseHeader]) -> Latency {
        let mut meter = LatencyMeter::default();
        poses.iter().for_each(|pose| meter.add(pose));
        meter.latency()
    }

    fn near(a: f64, b: f64) -> bool {
        (a - b).abs() <= 1e-3 * b
    }

    #[test]
    fn each_hop_is_measured() {
        let latency = measured(&[pose(0), pose(1_000_000)]);
        let masking = &latency.stages["masking"];
        assert!(masking.transport.is_some_and(|t| near(t.p50_us, 3.0)));
        assert!(near(masking.wait.max_us, 1.0) && near(masking.work.p99_us, 5.0));
        assert!(near(latency.sensor_to_pose.p50_us, 46.0));
        assert!(latency.stages["radar-replay"].transport.is_none());
        assert_eq!((latency.stages.len(), latency.overlap), (5, 0.0));
        // A hop apart they keep two stages busy at once.
        let latency = measured(&[pose(0), pose(10_000)]);
        assert!(near(latency.overlap, 4.0 * 5.0 / 55.0), "{latency:?}");
        assert_eq!(measured(&[]).sensor_to_pose, Percentiles::default());
    }
}
