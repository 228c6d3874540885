//! A message as a value.

use gyre_contract::{Item, Message};
use gyre_transport::{RunError, writer::TopicWriter};

use super::Tap;

/// A message outside of shared memory, of any topic of a stage.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Recorded {
    /// The bytes of the header, which starts with an [`Item`].
    pub header: Vec<u8>,
    pub payload: Vec<u8>,
    /// Time of receipt, `CLOCK_MONOTONIC`, ns; 0 for a synthetic message.
    pub received_ns: i64,
}

impl Recorded {
    pub fn of<M: Message>(header: &M::Header, payload: &[u8], received_ns: i64) -> Self {
        Self {
            header: bytemuck::bytes_of(header).to_vec(),
            payload: payload.to_vec(),
            received_ns,
        }
    }

    /// Receives the next message; `None` if there is no message yet.
    pub fn receive(tap: &Tap) -> Result<Option<Self>, RunError> {
        Ok(tap.receive()?.map(|received| Self {
            header: received.header_bytes().to_vec(),
            payload: received.values::<u8>().to_vec(),
            received_ns: received.received_ns,
        }))
    }

    /// Sends it as it is, with its time stamps, and notifies the readers.
    pub fn send(&self, feed: &TopicWriter) -> Result<(), RunError> {
        feed.send_unchanged(&self.header, &self.payload)
    }

    pub fn header<M: Message>(&self) -> Result<M::Header, RunError> {
        bytemuck::try_pod_read_unaligned(&self.header).map_err(|_| {
            RunError::Input(format!(
                "a header of {} bytes does not belong to topic `{}`",
                self.header.len(),
                M::TOPIC
            ))
        })
    }

    #[must_use]
    pub fn with<M: Message>(&self, header: &M::Header) -> Self {
        Self::of::<M>(header, &self.payload, self.received_ns)
    }

    pub fn item(&self) -> Item {
        bytemuck::pod_read_unaligned(&self.header[..size_of::<Item>()])
    }

    /// Returns this message about another scan.
    #[must_use]
    pub fn about(&self, item: &Item) -> Self {
        let mut changed = self.clone();
        changed.header[..size_of::<Item>()].copy_from_slice(bytemuck::bytes_of(item));
        changed
    }
}
