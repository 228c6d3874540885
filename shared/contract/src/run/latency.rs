//! Latency from the completion of a scan to its pose, hop by hop.

use std::{
    cmp::Reverse,
    collections::{BTreeMap, BinaryHeap},
};

use crate::{Hop, Hops, PoseHeader, StageId};
use hdrhistogram::Histogram;
use serde::Serialize;

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
struct HopMeter {
    /// From the publication by the stage before to the reception; empty of the first stage.
    transport: Durations,
    /// From the reception to the start of the work.
    wait: Durations,
    work: Durations,
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

    pub fn latency(self) -> Latency {
        let span_ns = self.span.map_or(0, |(first, last)| last - first).max(1) as f64;
        let hop = |meter: &HopMeter| HopLatency {
            transport: meter.transport.percentiles_if_any(),
            wait: meter.wait.percentiles(),
            work: meter.work.percentiles(),
            busy: meter.busy_ns as f64 / span_ns,
        };
        let stages = StageId::ALL.into_iter().zip(&self.stages);
        let stages: BTreeMap<_, _> = stages
            .filter(|(_, meter)| meter.work.count() > 0)
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

const DIGITS: u8 = 3;
/// The longest distinguished duration, ns: an hour.
const LONGEST_NS: u64 = 3_600_000_000_000;

#[derive(Debug, Default)]
pub struct Durations(Option<Histogram<u64>>);

impl Durations {
    /// Adds a duration. One below zero counts as zero, one above an hour as an hour.
    pub fn add(&mut self, duration_ns: i64) {
        if self.0.is_none() {
            // Fails for more than 5 digits alone.
            self.0 = Histogram::new_with_max(LONGEST_NS, DIGITS).ok();
        }
        if let Some(histogram) = &mut self.0 {
            histogram.saturating_record(u64::try_from(duration_ns).unwrap_or(0));
        }
    }

    pub fn count(&self) -> u64 {
        self.0.as_ref().map_or(0, Histogram::len)
    }

    /// Returns the duration, ns, that this share (0 to 1) of all does not exceed; `None` if there
    /// is no duration.
    pub fn at(&self, share: f64) -> Option<u64> {
        let histogram = self.0.as_ref()?;
        Some(histogram.value_at_quantile(share))
    }

    pub fn percentiles(&self) -> Percentiles {
        self.percentiles_if_any().unwrap_or_default()
    }

    /// Returns the percentiles; `None` if there is no duration.
    pub fn percentiles_if_any(&self) -> Option<Percentiles> {
        let histogram = self.0.as_ref()?;
        let at = |share| histogram.value_at_quantile(share) as f64 * 1e-3;
        Some(Percentiles {
            p50_us: at(0.5),
            p90_us: at(0.9),
            p99_us: at(0.99),
            max_us: histogram.max() as f64 * 1e-3,
        })
    }
}

/// Starts (+1) and ends (-1) of work in the order of time. Work earlier than the first work on the
/// newest scan is final, so only the scans in flight are kept.
#[derive(Debug, Default)]
struct Overlap {
    edges: BinaryHeap<Reverse<(i64, i32)>>,
    busy: i32,
    since_ns: i64,
    together_ns: i64,
}

impl Overlap {
    fn add(&mut self, hops: &Hops) {
        let worked = |hop: &&Hop| **hop != Hop::default();
        for hop in hops.iter().filter(worked) {
            self.edges.push(Reverse((hop.started_ns, 1)));
            self.edges.push(Reverse((hop.finished_ns, -1)));
        }
        self.sweep(hops[0].started_ns);
    }

    /// Returns the time while two or more stages worked at once, ns.
    fn together_ns(mut self) -> i64 {
        self.sweep(i64::MAX);
        self.together_ns
    }

    fn sweep(&mut self, until_ns: i64) {
        while let Some(Reverse((at_ns, change))) = self.edges.peek().copied() {
            if at_ns >= until_ns {
                break;
            }
            self.edges.pop();
            if self.busy >= 2 {
                self.together_ns += at_ns - self.since_ns;
            }
            self.busy += change;
            self.since_ns = at_ns;
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::Item;

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

    #[test]
    fn only_the_scans_in_flight_are_kept() {
        let mut overlap = Overlap::default();
        for scan in 0..1000 {
            let hop = |k: i64| Hop {
                started_ns: scan * 10 + k * 10,
                finished_ns: scan * 10 + k * 10 + 8,
                ..Hop::default()
            };
            overlap.add(&std::array::from_fn(|k| hop(k as i64 + 1)));
            assert!(overlap.edges.len() <= 2 * 7 * 8, "{}", overlap.edges.len());
        }
        // Seven stages work at once for 8 of 10 ns; alone are the first and the last scan's ends.
        assert_eq!(overlap.together_ns(), 8 * (1000 + 6 - 2));
    }
}
