//! Counters of a stage's own work.

use serde::{Deserialize, Serialize};

use crate::allocations;

/// What one process of a stage counted, from its start to its orderly end.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StageCounters {
    /// Items processed.
    pub processed: u64,
    /// Heap allocations in `process` after its first five items; `None` where the program does not count them
    /// (see [`CountingAllocator`](crate::CountingAllocator)).
    pub allocations_after_five: Option<u64>,
    /// Heap allocations in `process` during its first five items.
    pub allocations_in_first_five: Option<u64>,
    /// Items that came twice and were skipped: they had been sent before a neighbour's restart.
    pub duplicates: u64,
    /// Times that the process woke up.
    pub wakes: u64,
    /// Wake-ups that were lost and caught by the longest wait.
    pub wakes_caught_late: u64,
    /// Scans that could not be read and were left out (the source).
    pub unreadable: u64,
    /// Time by which a simulation in live mode fell behind the rate, since it is rendered more slowly, ns (the source).
    pub slipped_ns: u64,
    /// Time spent in `process`, ns.
    pub busy_ns: u64,
}

/// The file that a stage leaves its counters in, in the run's root.
pub(crate) fn file_name(stage: &str) -> String {
    format!("{stage}.counters.json")
}

/// Items that may allocate: buffers grow while the first few are processed.
const WARM_UP: u64 = 5;

impl StageCounters {
    /// Counts one item's work.
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
