//! The publisher of a topic whose messages come as bytes: from a recording, or from another machine.

use gyre_messages::{
    Header, Item, Masked, Message, Motion, Refined, Rotation, Scan, StageId, flag,
};

use crate::{Launch, Listener, StageError, writer::Writer};

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
pub(crate) trait Outlet {
    fn topic(&self) -> &'static str;
    /// Publishes a message with this item.
    fn send(&self, message: &RecordedMessage, item: Item) -> Result<(), StageError>;
    /// Publishes the end of the stream.
    fn end(&self, item: Item) -> Result<(), StageError>;
    fn accept_readers(&self) -> Result<(), StageError>;
    fn listener(&self) -> &Listener;
}

/// Opens a topic of the stream for publishing.
pub(crate) fn outlet(launch: &Launch, topic: &str) -> Result<Box<dyn Outlet>, StageError> {
    let (node, manifest) = (&launch.node, &launch.manifest);
    Ok(match topic {
        Scan::TOPIC => Box::new(Writer::<Scan>::open(node, manifest)?),
        Masked::TOPIC => Box::new(Writer::<Masked>::open(node, manifest)?),
        Rotation::TOPIC => Box::new(Writer::<Rotation>::open(node, manifest)?),
        Motion::TOPIC => Box::new(Writer::<Motion>::open(node, manifest)?),
        Refined::TOPIC => Box::new(Writer::<Refined>::open(node, manifest)?),
        _ => {
            let reason = format!("a source does not publish the topic `{topic}`");
            return Err(StageError::Configuration(reason));
        }
    })
}

impl<M: Message> Outlet for Writer<M> {
    fn topic(&self) -> &'static str {
        M::TOPIC
    }

    fn send(&self, message: &RecordedMessage, item: Item) -> Result<(), StageError> {
        let mut draft = self.loan()?;
        let (header, payload) = draft.parts::<u8>();
        let (bytes, room) = (message.payload.len(), payload.len());
        let is_whole = message.header.len() == size_of::<M::Header>();
        let Some(content) = payload.get_mut(..bytes).filter(|_| is_whole) else {
            return Err(StageError::Input(format!(
                "the recorded message {} of topic `{}` has {bytes} bytes, and this run has room for {room}: its configuration is not that of the recorded run",
                item.seq,
                M::TOPIC
            )));
        };
        content.copy_from_slice(&message.payload);
        // What is behind it in memory has no meaning, and is not to differ from run to run.
        payload[bytes..].fill(0);
        *header = bytemuck::pod_read_unaligned(&message.header);
        *header.item_mut() = item;
        Writer::send(self, draft, StageId::RadarReplay)
    }

    fn end(&self, item: Item) -> Result<(), StageError> {
        let mut draft = self.loan()?;
        *draft.header().item_mut() = Item {
            flags: flag::END,
            ..item
        };
        Writer::send(self, draft, StageId::RadarReplay)
    }

    fn accept_readers(&self) -> Result<(), StageError> {
        Writer::accept_readers(self)
    }

    fn listener(&self) -> &Listener {
        Writer::listener(self)
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
