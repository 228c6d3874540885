//! The figures of a run.

use gyre_contract::WitnessCounts;
use serde::Serialize;

use crate::stress::{
    fault::Fault,
    processes::Cost,
    record::{Counts, RunLatency},
    witness_fault::WitnessFault,
};

#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Figures {
    #[serde(flatten)]
    pub latency: RunLatency,
    pub faults: Vec<Fault>,
    /// Faults of gyro, wheels and radar, and recoveries.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub witness_faults: Vec<WitnessFault>,
    /// The basis of the motions of the first turn of the recording.
    pub motions: WitnessCounts,
    pub processes: Vec<Cost>,
    pub shared_bytes: u64,
}

impl Figures {
    /// Returns the share of the scans that were due and have no pose, %.
    pub fn drops_percent(&self) -> Option<f64> {
        let Counts { due, dropped, .. } = self.latency.counts;
        (due > 0).then(|| 100.0 * dropped as f64 / due as f64)
    }

    pub fn had_faults(&self) -> bool {
        !self.faults.is_empty() || !self.witness_faults.is_empty()
    }

    /// Returns the longest recovery from a fault, ms; `None` if a fault had no recovery.
    pub fn longest_recovery_ms(&self) -> Option<f64> {
        let of_stages = self.faults.iter().map(|fault| fault.recovery_ms);
        let of_others = self.witness_faults.iter().map(|fault| fault.recovery_ms);
        let all: Option<Vec<f64>> = of_stages.chain(of_others).collect();
        all?.into_iter().reduce(f64::max)
    }

    /// Returns a sentence such as
    /// `p50 4.5, p99 7.0 of 480, max 7.2 ms; 0 of 480 scans dropped; processor 3.8 %, memory 9 MB`.
    pub(super) fn sentence(&self) -> String {
        let (cpu, memory) = (self.cpu_percent(), self.memory_mb());
        let used = format!("processor {cpu:.1} %, memory {memory:.0} MB");
        if self.latency.counts.due == 0 {
            return used;
        }
        let latency = &self.latency.sensor_to_pose;
        let ms = |ms: Option<f64>| ms.map_or("-".to_owned(), |ms| format!("{ms:.1}"));
        let Counts { due, dropped, .. } = self.latency.counts;
        let (p50, max) = (ms(latency.p50_ms), ms(latency.max_ms));
        let p99 = ms(latency.p99_ms) + &latency.p99_mark();
        let faults = match self.faults.len() + self.witness_faults.len() {
            0 => String::new(),
            1 => "; 1 fault".to_owned(),
            faults => format!("; {faults} faults"),
        };
        format!(
            "p50 {p50}, p99 {p99}, max {max} ms; {dropped} of {due} scans dropped{faults}; {used}"
        )
    }

    pub fn cpu_percent(&self) -> f64 {
        self.processes.iter().map(|cost| cost.cpu_percent).sum()
    }

    pub fn memory_mb(&self) -> f64 {
        let own: f64 = self.processes.iter().map(|cost| cost.own_mb).sum();
        own + self.shared_bytes as f64 * 1e-6
    }
}
