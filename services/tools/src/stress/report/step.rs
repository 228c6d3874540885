//! Steps of a search for the largest load.

use serde::Serialize;

use super::Figures;
use crate::stress::{check::Check, record::Distribution};

/// A step of a search for the largest load.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Step {
    /// Scans a second, or radars.
    pub level: f64,
    /// True if all its pipelines keep the limits.
    pub passed: bool,
    /// Scans that were due, in all pipelines.
    pub due: u64,
    /// Scans without a pose, in all pipelines.
    pub dropped: u64,
    /// The largest median of its pipelines, ms.
    pub p50_ms: Option<f64>,
    /// The largest 99th percentile of its pipelines, ms; of fewer than a hundred scans the maximum.
    pub p99_ms: Option<f64>,
    /// Processor time of all pipelines, % of one processor.
    pub cpu_percent: f64,
    /// The reason why it has not passed.
    pub reason: Option<String>,
}

impl Step {
    /// A step whose runs could not be started.
    pub fn not_started(level: f64, reason: String) -> Self {
        Self {
            level,
            passed: false,
            due: 0,
            dropped: 0,
            p50_ms: None,
            p99_ms: None,
            cpu_percent: 0.0,
            reason: Some(reason),
        }
    }

    /// A step with the checks, the problem and the figures of each of its pipelines.
    pub fn of(level: f64, pipelines: Vec<(Vec<Check>, Option<String>, Figures)>) -> Self {
        let figures = || pipelines.iter().map(|(.., figures)| figures);
        let largest = |of: fn(&Distribution) -> Option<f64>| {
            let latencies = figures().map(|it| &it.latency.sensor_to_pose);
            latencies
                .filter_map(|it| it.judged(of(it)))
                .reduce(f64::max)
        };
        let reason = pipelines.iter().find_map(|(checks, problem, _)| {
            let failed = checks.iter().find(|check| !check.passed);
            problem.clone().or_else(|| failed.map(Check::sentence))
        });
        Self {
            level,
            passed: reason.is_none(),
            due: figures().map(|it| it.latency.counts.due).sum(),
            dropped: figures().map(|it| it.latency.counts.dropped).sum(),
            p50_ms: largest(|latency| latency.p50_ms),
            p99_ms: largest(|latency| latency.p99_ms),
            cpu_percent: figures().map(Figures::cpu_percent).sum(),
            reason,
        }
    }

    /// Returns `8.0 scans/s: p99 14.2 ms, 0 of 80 dropped`.
    pub fn sentence(&self, unit: &str) -> String {
        let Self { due, dropped, .. } = self;
        let p99 = self
            .p99_ms
            .map_or("no pose".to_owned(), |ms| format!("p99 {ms:.1} ms"));
        let reason = self
            .reason
            .as_ref()
            .map_or(String::new(), |reason| format!(": {reason}"));
        format!(
            "  {:.1} {unit}: {p99}, {dropped} of {due} dropped{reason}",
            self.level
        )
    }
}
