//! The pipeline that is tested.

use std::{path::PathBuf, time::Duration};

use gyre_messages::StageId;
use gyre_run::Budget;

/// The pipeline that is tested.
#[derive(Clone, Debug)]
pub struct TestedPipeline {
    /// The program `gyre`.
    pub program: PathBuf,
    /// The resolved configuration, whose source is a recording.
    pub configuration: PathBuf,
    /// The folder of the report.
    pub out: PathBuf,
    /// Time between two scans of the recording.
    pub period: Duration,
    /// The stages of the run.
    pub stages: Vec<StageId>,
    /// The budget.
    pub budget: Budget,
    /// The messages whose transport is compared with copies.
    pub kinds: Vec<MessageKind>,
    /// Shared memory of a run, bytes.
    pub shared_bytes: u64,
}

/// A kind of message, by its size.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MessageKind {
    /// The topic of this size.
    pub topic: &'static str,
    /// Bytes of a message.
    pub bytes: usize,
}
