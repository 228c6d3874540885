//! Messages that come as bytes: from a recording, or from another machine.

use gyre_messages::{Item, Message, Pose, Sender, StageId};

use crate::{Launch, StageError, writer::TopicWriter};

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

impl TopicWriter {
    /// Opens topics of the stream for publishing, in the place of the source.
    pub(crate) fn of_stream(launch: &Launch, topics: &[&str]) -> Result<Vec<Self>, StageError> {
        let of_stream = |topic: &&str| {
            let found = gyre_messages::topic(topic)
                .filter(|it| matches!(it.sender, Sender::Stage(_)) && it.name != Pose::TOPIC);
            let topic = found.ok_or_else(|| {
                let reason = format!("a source does not publish the topic `{topic}`");
                StageError::Configuration(reason)
            })?;
            Self::open(&launch.node, &launch.manifest, topic)
        };
        topics.iter().map(of_stream).collect()
    }

    /// Publishes a message with this item, in the place of the source.
    pub(crate) fn republish(
        &self,
        message: &RecordedMessage,
        item: Item,
    ) -> Result<(), StageError> {
        let mut loan = self.loan()?;
        let (header, payload) = loan.parts();
        let (bytes, room) = (message.payload.len(), payload.len());
        let is_whole = message.header.len() == header.len();
        let Some(content) = payload.get_mut(..bytes).filter(|_| is_whole) else {
            return Err(StageError::Input(format!(
                "the recorded message {} of topic `{}` has {bytes} bytes, and this run has room for {room}: its configuration is not that of the recorded run",
                item.seq, self.topic
            )));
        };
        content.copy_from_slice(&message.payload);
        // The memory behind it has no meaning, and must not differ from run to run.
        payload[bytes..].fill(0);
        header.copy_from_slice(&message.header);
        *loan.item() = item;
        self.send(loan, Some(StageId::RadarReplay))
    }
}

/// Returns the item of the messages of a scan without the times of the run that they are from.
pub(crate) fn item_of<'a>(
    messages: impl IntoIterator<Item = &'a RecordedMessage>,
    seq: u64,
) -> Result<Item, StageError> {
    let item = messages.into_iter().next().and_then(RecordedMessage::item);
    match item.filter(|item| item.seq == seq) {
        Some(item) => Ok(Item {
            hops: Default::default(),
            ..item
        }),
        None => Err(StageError::Input(format!(
            "the recorded message {seq} is another one"
        ))),
    }
}
