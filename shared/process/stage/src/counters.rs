//! The counters of a stage.

use std::{fs, path::PathBuf};

use serde::{Deserialize, Serialize};

use crate::{Manifest, StageError, allocations, run};

/// Counters of one process of a stage, from its start to its clean exit.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StageCounters {
    /// Items processed.
    pub processed: u64,
    /// Heap allocations in `process` after its first five items; `None` if the program does not
    /// count them (see [`CountingAllocator`](crate::CountingAllocator)).
    pub allocations_after_five: Option<u64>,
    /// Heap allocations in `process` during its first five items.
    pub allocations_in_first_five: Option<u64>,
    /// Items that were received twice and skipped, because a restarted publisher sent them again.
    pub duplicates: u64,
    /// Number of wake-ups.
    pub wakes: u64,
    /// Lost wake-ups: input was found only after the longest wait.
    pub wakes_caught_late: u64,
    /// Scans that could not be read and were skipped (source only).
    pub unreadable: u64,
    /// Azimuths that are missing from the published scans of a live radar (source only). This and
    /// the next four are counts since the start of the run, also of sources that have died.
    pub missing_azimuths: u64,
    /// Turns of a live radar of which there is no scan: nothing arrived, the connection broke in
    /// the middle, half of the azimuths are missing, or times that do not increase (source only).
    pub scans_left_out: u64,
    /// Messages of a live radar that could not be read (source only).
    pub damaged_messages: u64,
    /// Datagrams of others than the live radar, and descriptions of scans that do not fit into the
    /// run (source only).
    pub foreign_messages: u64,
    /// Connections to a live radar after the first (source only).
    pub reconnections: u64,
    /// Delay of a simulation in live mode that is rendered more slowly than its rate, ns (source
    /// only).
    pub slipped_ns: u64,
    /// Time spent in `process`, ns.
    pub busy_ns: u64,
}

/// Returns the file in the run's root to which a stage writes its counters.
fn path_of(manifest: &Manifest, stage: &str) -> PathBuf {
    manifest.root.join(format!("{stage}.counters.json"))
}

/// Items that may allocate, since buffers grow at first.
const WARM_UP: u64 = 5;

impl StageCounters {
    /// Reads the counters of a stage; `None` if it has not exited cleanly.
    #[must_use]
    pub fn of(manifest: &Manifest, stage: &str) -> Option<Self> {
        let text = fs::read_to_string(path_of(manifest, stage)).ok()?;
        serde_json::from_str(&text).ok()
    }

    pub(crate) fn write(&self, manifest: &Manifest, stage: &str) -> Result<(), StageError> {
        let text =
            serde_json::to_string(self).map_err(|e| StageError::Configuration(e.to_string()))?;
        run::write(path_of(manifest, stage), &text)
    }

    /// Counts the work on one item.
    pub(crate) fn record(&mut self, allocations: u64, busy_ns: i64) {
        if allocations::are_counted() {
            let count = match self.processed < WARM_UP {
                true => &mut self.allocations_in_first_five,
                false => &mut self.allocations_after_five,
            };
            *count.get_or_insert(0) += allocations;
        }
        self.processed += 1;
        self.busy_ns += busy_ns.max(0) as u64;
    }
}
