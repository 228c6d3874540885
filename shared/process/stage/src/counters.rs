//! The counters of a stage.

use std::{fs, path::PathBuf};

use gyre_run::StageCounters;

use crate::{Manifest, StageError, allocations, clock, run};

fn path_of(manifest: &Manifest, stage: &str) -> PathBuf {
    manifest.root.join(format!("{stage}.counters.json"))
}

/// Items that may allocate, since buffers grow at first.
const WARM_UP: u64 = 5;

/// Reads the counters of a stage; `None` if it has not exited cleanly.
#[must_use]
pub fn read(manifest: &Manifest, stage: &str) -> Option<StageCounters> {
    let text = fs::read_to_string(path_of(manifest, stage)).ok()?;
    serde_json::from_str(&text).ok()
}

pub(crate) fn write(
    counters: &StageCounters,
    manifest: &Manifest,
    stage: &str,
) -> Result<(), StageError> {
    let text =
        serde_json::to_string(counters).map_err(|e| StageError::Configuration(e.to_string()))?;
    run::write(path_of(manifest, stage), &text)
}

pub(crate) fn record(counters: &mut StageCounters, allocations: u64, busy_ns: i64) {
    if allocations::are_counted() {
        let count = match counters.processed < WARM_UP {
            true => &mut counters.allocations_in_first_five,
            false => &mut counters.allocations_after_five,
        };
        *count.get_or_insert(0) += allocations;
    }
    counters.processed += 1;
    counters.busy_ns += busy_ns.max(0) as u64;
}

pub(crate) struct Work {
    pub started_ns: i64,
    allocated: u64,
}

impl Work {
    pub fn begin() -> Self {
        Self {
            started_ns: clock::now_ns(),
            allocated: allocations::so_far(),
        }
    }

    /// Counts the work; returns its end, ns.
    pub fn end(&self, counters: &mut StageCounters) -> i64 {
        let finished_ns = clock::now_ns();
        let allocations = allocations::so_far() - self.allocated;
        record(counters, allocations, finished_ns - self.started_ns);
        finished_ns
    }
}
