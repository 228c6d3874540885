//! A topic that is published, with counts.

use ros2_client::{Publisher, WriteError};
use serde::Serialize;

/// A topic that is published. A message without room is not sent, and counted.
pub struct Outlet<M: Serialize> {
    publisher: Publisher<M>,
    sent: u64,
    unsent: u64,
}

impl<M: Serialize> Outlet<M> {
    pub fn new(publisher: Publisher<M>) -> Self {
        Self {
            publisher,
            sent: 0,
            unsent: 0,
        }
    }

    /// Sends a message, and waits at most a tenth of a second for readers that are behind.
    pub fn send(&mut self, message: M) {
        match self.publisher.publish(message) {
            Ok(()) => self.sent += 1,
            Err(error) => {
                self.unsent += 1;
                if self.unsent.is_power_of_two() && !matches!(error, WriteError::WouldBlock { .. })
                {
                    let unsent = self.unsent;
                    tracing::warn!(unsent, "a message was not sent: {:?}", error.forget_data());
                }
            }
        }
    }

    /// Returns the number of messages that were sent.
    pub fn sent(&self) -> u64 {
        self.sent
    }

    /// Returns the number of messages that were not sent.
    pub fn unsent(&self) -> u64 {
        self.unsent
    }
}
