//! What a stage counts of its own work.

use serde::{Deserialize, Serialize};

/// One life of a stage, as it tells at its orderly end.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Statistics {
    /// Items processed.
    pub processed: u64,
    /// Heap allocations in `process` after its first five items.
    pub allocations_after_five: u64,
    /// Heap allocations in `process` during its first five items.
    pub allocations_in_first_five: u64,
    /// Items that came twice and were skipped: they had been sent before a neighbour's restart.
    pub duplicates: u64,
    /// Times that the process woke up.
    pub wakes: u64,
    /// Wake-ups that were lost and caught by the time limit of the wait.
    pub wakes_caught_late: u64,
    /// Scans that could not be read and were left out (the source).
    pub unreadable: u64,
    /// By how much a simulation in live mode fell behind the rate, for it is not rendered as fast, ns (the source).
    pub slipped_ns: u64,
    /// Time spent in `process`, ns.
    pub busy_ns: u64,
}

/// Where a stage leaves them, in the run's root: its last life's are what counts.
pub(crate) fn file_name(stage: &str) -> String {
    format!("{stage}.statistics.json")
}

/// Items that may allocate: the first few grow what is then kept.
pub(crate) const WARM_UP: u64 = 5;

impl Statistics {
    /// Counts one item's work.
    pub(crate) fn record(&mut self, allocations: u64, busy_ns: i64) {
        match self.processed < WARM_UP {
            true => self.allocations_in_first_five += allocations,
            false => self.allocations_after_five += allocations,
        }
        self.processed += 1;
        self.busy_ns += busy_ns.max(0) as u64;
    }
}
