//! A topic that is published.

use ros2_client::{Publisher, WriteError, dds::rustdds::DomainParticipant};
use serde::Serialize;

/// A topic that is published. A message without room is not sent.
pub struct Outlet<M: Serialize> {
    publisher: Publisher<M>,
    participant: DomainParticipant,
    dds_name: String,
    unsent: u64,
}

impl<M: Serialize> Outlet<M> {
    pub fn new(publisher: Publisher<M>, participant: DomainParticipant, dds_name: String) -> Self {
        Self {
            publisher,
            participant,
            dds_name,
            unsent: 0,
        }
    }

    /// Returns whether it is the topic of this absolute name.
    pub fn is(&self, topic: &str) -> bool {
        self.dds_name == format!("rt/{}", topic.trim_start_matches('/'))
    }

    /// Returns whether a reader of the topic has been found.
    pub fn has_reader(&self) -> bool {
        let readers = self.participant.discovered_readers();
        let mut topics = readers.iter().map(|reader| &reader.subscription_topic_data);
        topics.any(|topic| topic.topic_name == self.dds_name)
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
