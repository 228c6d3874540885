//! The delays of all poses, in buckets as Prometheus counts them.

use gyre_contract::{Item, StageId};
use prometheus_client::metrics::{family::Family, histogram::Histogram};

const HOP_BUCKETS_S: [f64; 15] = [
    0.000_05, 0.000_1, 0.000_25, 0.000_5, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5,
    1.0, 2.5,
];
const POSE_BUCKETS_S: [f64; 14] = [
    0.001, 0.0025, 0.005, 0.0075, 0.01, 0.025, 0.05, 0.075, 0.1, 0.25, 0.5, 1.0, 2.5, 10.0,
];

#[derive(Clone, Debug)]
pub struct Histograms {
    pub sensor_to_pose: Histogram,
    pub hops: Family<HopLabels, Histogram, fn() -> Histogram>,
}

/// A stage, and a part of its time for a scan: `transport`, `wait` or `work`.
type HopLabels = [(&'static str, &'static str); 2];

impl Default for Histograms {
    fn default() -> Self {
        Self {
            sensor_to_pose: Histogram::new(POSE_BUCKETS_S),
            hops: Family::new_with_constructor(|| Histogram::new(HOP_BUCKETS_S)),
        }
    }
}

impl Histograms {
    pub fn add(&self, item: &Item) {
        let seconds = |duration_ns: i64| duration_ns as f64 * 1e-9;
        self.sensor_to_pose
            .observe(seconds(item.sensor_to_pose_ns()));
        for times in item.hop_times() {
            let parts = [
                ("transport", times.transport_ns),
                ("wait", Some(times.wait_ns)),
                ("work", Some(times.work_ns)),
            ];
            for (part, duration_ns) in parts {
                let Some(duration_ns) = duration_ns else {
                    continue;
                };
                let stage = StageId::name(times.stage);
                let labels = [("stage", stage), ("part", part)];
                self.hops
                    .get_or_create(&labels)
                    .observe(seconds(duration_ns));
            }
        }
    }
}
