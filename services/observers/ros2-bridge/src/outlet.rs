//! A topic that is published.

use ros2_client::{Publisher, WriteError};
use serde::Serialize;

/// A topic that is published. A message without room is not sent.
pub struct Outlet<M: Serialize> {
    publisher: Publisher<M>,
    unsent: u64,
}

impl<M: Serialize> Outlet<M> {
    pub fn new(publisher: Publisher<M>) -> Self {
        Self {
            publisher,
            unsent: 0,
        }
    }

    /// Sends a message, and waits at most a tenth of a second for readers that are behind; returns
    /// whether it was sent.
    pub fn send(&mut self, message: M) -> bool {
        let Err(error) = self.publisher.publish(message) else {
            return true;
        };
        self.unsent += 1;
        if self.unsent.is_power_of_two() && !matches!(error, WriteError::WouldBlock { .. }) {
            let unsent = self.unsent;
            tracing::warn!(unsent, "a message was not sent: {:?}", error.forget_data());
        }
        false
    }
}
