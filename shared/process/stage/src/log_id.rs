//! The logs of a run, and the events of their growth.

use crate::{Launch, StageError, transport::Notifier};

gyre_messages::named! {
    /// A log of a run that followers read; its name is the event of its growth.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum LogId {
        Keyframes = "keyframes_grown",
        Loops = "loops_grown",
        /// All scans with their points, by pose-integration.
        Scans = "scans_grown",
    }
}

/// Notifies the followers of a log. A run without SLAM and objects has no such events.
pub struct Growth(Notifier);

impl Growth {
    /// Opens the event of a log, as the one process that appends to it.
    pub fn of(launch: &Launch, log: LogId) -> Result<Self, StageError> {
        Notifier::open(&launch.node, log.name()).map(Self)
    }

    /// Wakes the followers: a record was appended.
    pub fn notify(&self) -> Result<(), StageError> {
        self.0.notify()
    }
}
