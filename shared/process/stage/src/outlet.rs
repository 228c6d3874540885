//! The publisher of a topic whose messages come as bytes: from a recording, or from another
//! machine.

use gyre_messages::{Item, Message, Pose, Sender, StageId, flag};

use crate::{Launch, Listener, StageError, writer::UntypedWriter};

/// A wire message outside of shared memory.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RecordedMessage {
    /// The bytes of its header.
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

/// The publisher of a topic, whatever its type, in the place of the source.
pub(crate) struct Outlet(UntypedWriter);

impl Outlet {
    /// Opens a topic of the stream for publishing.
    pub(crate) fn open(launch: &Launch, topic: &str) -> Result<Self, StageError> {
        let of_stream = gyre_messages::topic(topic)
            .filter(|topic| matches!(topic.sender, Sender::Stage(_)) && topic.name != Pose::TOPIC);
        let Some(topic) = of_stream else {
            let reason = format!("a source does not publish the topic `{topic}`");
            return Err(StageError::Configuration(reason));
        };
        UntypedWriter::open(&launch.node, &launch.manifest, topic).map(Self)
    }

    pub(crate) fn topic(&self) -> &'static str {
        self.0.topic()
    }

    /// Publishes a message with this item.
    pub(crate) fn send(&self, message: &RecordedMessage, item: Item) -> Result<(), StageError> {
        let mut loan = self.0.loan()?;
        let (header, payload) = loan.parts();
        let (bytes, room) = (message.payload.len(), payload.len());
        let is_whole = message.header.len() == header.len();
        let Some(content) = payload.get_mut(..bytes).filter(|_| is_whole) else {
            return Err(StageError::Input(format!(
                "the recorded message {} of topic `{}` has {bytes} bytes, and this run has room for {room}: its configuration is not that of the recorded run",
                item.seq,
                self.topic()
            )));
        };
        content.copy_from_slice(&message.payload);
        // The memory behind it has no meaning, and must not differ from run to run.
        payload[bytes..].fill(0);
        header.copy_from_slice(&message.header);
        *loan.item() = item;
        self.0.send(loan, StageId::RadarReplay)
    }

    /// Publishes the end of the stream.
    pub(crate) fn end(&self, item: Item) -> Result<(), StageError> {
        let mut loan = self.0.loan()?;
        *loan.item() = Item {
            flags: flag::END,
            ..item
        };
        self.0.send(loan, StageId::RadarReplay)
    }

    pub(crate) fn accept_readers(&self) -> Result<(), StageError> {
        self.0.accept_readers()
    }

    pub(crate) fn listener(&self) -> &Listener {
        self.0.listener()
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
