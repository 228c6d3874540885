//! What is stressed.

use std::{path::PathBuf, time::Duration};

use gyre_messages::StageId;

use crate::budget::Budget;

/// What is stressed.
#[derive(Clone, Debug)]
pub struct Subject {
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
    /// Its budget.
    pub budget: Budget,
    /// The messages whose hand-over is compared with copies.
    pub kinds: Vec<Kind>,
    /// Shared memory of a run, bytes.
    pub shared_bytes: u64,
}

/// A kind of message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Kind {
    /// The topic whose messages are so large.
    pub topic: &'static str,
    /// Bytes of a message.
    pub bytes: usize,
}
