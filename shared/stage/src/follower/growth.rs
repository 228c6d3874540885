//! Wakes the followers when a log has grown.

use crate::{
    Launch, StageError,
    services::{self, Notifier},
};

/// A log of a run that followers read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LogId {
    /// The keyframes, by pose-integration.
    Keyframes,
    /// The loops, by loop-closure.
    Loops,
}

/// All of them.
pub(crate) const LOGS: [LogId; 2] = [LogId::Keyframes, LogId::Loops];

impl LogId {
    /// Returns the name of the event of its growth.
    pub(crate) const fn event(self) -> &'static str {
        match self {
            Self::Keyframes => "keyframes_grown",
            Self::Loops => "loops_grown",
        }
    }
}

/// Notifies the followers of a log. A run without SLAM has no such events.
pub struct Growth {
    log: LogId,
    notifier: Notifier,
}

impl Growth {
    /// Opens the event of a log, as the one process that appends to it.
    ///
    /// # Errors
    /// A failure of the transport.
    pub fn of(launch: &Launch, log: LogId) -> Result<Self, StageError> {
        let notifier = services::notifier(&launch.node, log.event())?;
        Ok(Self { log, notifier })
    }

    /// Wakes the followers: a record was appended.
    ///
    /// # Errors
    /// A failure of the transport.
    pub fn notify(&self) -> Result<(), StageError> {
        let notified = self.notifier.notify();
        let failed = |e| StageError::transport(format!("notify {}", self.log.event()), e);
        notified.map(drop).map_err(failed)
    }
}
