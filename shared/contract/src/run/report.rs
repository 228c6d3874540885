//! The report of a run at its end.

use std::{collections::BTreeMap, time::Duration};

use serde::{Deserialize, Serialize};

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ending {
    /// All scans are in the trajectory.
    Complete,
    Interrupted,
}

/// The supervisor's report at the end of a run.
#[derive(Debug)]
pub struct Report {
    /// The end of the run.
    pub ending: Ending,
    pub restarts: BTreeMap<String, usize>,
    /// Time from each death to the first pose with work of the new process.
    pub recovery: Vec<Duration>,
    pub counters: BTreeMap<String, StageCounters>,
    pub swaps: Vec<Swapped>,
}

/// A program that has taken the place of a stage.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Swapped {
    pub stage: String,
    pub command: Vec<String>,
    pub after_poses: u64,
}

/// Counters of one process of a stage, from its start to its clean exit.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StageCounters {
    pub processed: u64,
    /// Heap allocations in `process` after its first five items; `None` if the program does not
    /// count them (see `CountingAllocator` of `gyre-stage`).
    pub allocations_after_five: Option<u64>,
    /// Heap allocations in `process` during its first five items.
    pub allocations_in_first_five: Option<u64>,
    /// Items that were received twice and skipped, because a restarted publisher sent them again.
    pub duplicates: u64,
    pub wakes: u64,
    /// Lost wake-ups: input was found only after the longest wait.
    pub wakes_caught_late: u64,
    /// Scans that could not be read and were skipped (source only).
    pub unreadable: u64,
    /// Azimuths that are missing from the published scans of a live radar (source only). This and
    /// the next four are counts since the start of the run, also of sources that have died.
    pub missing_azimuths: u64,
    /// Turns of a live radar without a scan: nothing arrived, the connection broke in the middle,
    /// half of the azimuths are missing, or times do not increase (source only).
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
    pub busy_ns: u64,
}
