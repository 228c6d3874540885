//! The options of a comparison.

use std::{path::PathBuf, time::Duration};

use gyre_harness::Scheduling;
use gyre_messages::StageId;

/// The program, the stage that it shadows, and the limits of the comparison.
#[derive(Clone, Debug)]
pub struct Options {
    /// The stage.
    pub stage: StageId,
    /// The program and its arguments.
    pub command: Vec<String>,
    /// The program of the guardian, which ends the shadow if this process is killed.
    pub gyre: String,
    /// The priority of the shadow.
    pub scheduling: Scheduling,
    /// Time for it to open its topics.
    pub start_timeout: Duration,
    /// Time for an item.
    pub item_timeout: Duration,
    /// Items to compare; `None`: until the run ends.
    pub scans: Option<u64>,
    /// Time after which it ends.
    pub duration: Option<Duration>,
    /// A folder for `shadow.json`, `shadow.csv`, and the output of the program, `shadow.txt`.
    pub report: Option<PathBuf>,
}
