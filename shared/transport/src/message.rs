//! Messages of any type.

use gyre_contract::Item;

/// Stands for the message type of a topic that is known by its name alone.
pub enum AnyMessage {}

/// A wire message outside of shared memory.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RecordedMessage {
    pub header: Vec<u8>,
    /// The bytes of its payload that the header describes.
    pub payload: Vec<u8>,
}

impl RecordedMessage {
    /// Returns the scan that it is about; `None` if its header is too short.
    pub fn item(&self) -> Option<Item> {
        let item = self.header.get(..size_of::<Item>())?;
        Some(bytemuck::pod_read_unaligned(item))
    }
}
