//! Wakes the followers when a log has grown.

use crate::{Launch, StageError, log_id::LogId, transport::Notifier};

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
