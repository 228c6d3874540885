//! The publisher of a topic.

use std::{fs::File, marker::PhantomData, path::Path, slice};

use gyre_contract::{Item, Message, Pose, Sender, StageId, Topic, flag};
use iceoryx2::{
    port::{publisher::Publisher, update_connections::UpdateConnections},
    prelude::BackpressureStrategy,
    sample_mut::SampleMut,
};
use rustix::fs::{FallocateFlags, fallocate};

use crate::{
    Manifest, RunError, clock,
    message::{AnyMessage, RecordedMessage},
    run::{self, SHARED_MEMORY},
    transport::{
        AnyHeader, AnyPayload, Ipc, Listener, Node, Notifier, Service, data_event, handshake_event,
    },
};

/// Publishes the messages of a topic and keeps a history for late readers: see
/// [`accept_readers`](Self::accept_readers).
pub struct Writer<M> {
    pub topic: &'static str,
    handshake: Listener,
    data: Notifier,
    header_bytes: usize,
    elements: usize,
    port: Publisher<Ipc, AnyPayload, AnyHeader>,
    message: PhantomData<M>,
}

/// A [`Writer`] of messages of any type, as bytes.
pub type TopicWriter = Writer<AnyMessage>;

pub struct Draft<M> {
    sample: SampleMut<Ipc, AnyPayload, AnyHeader>,
    header_bytes: usize,
    message: PhantomData<M>,
}

impl<M: Message> Writer<M> {
    pub fn open(node: &Node, manifest: &Manifest) -> Result<Self, RunError> {
        Self::to(M::ENTRY, node, manifest)
    }

    pub fn publish(&self, header: M::Header, hop: Option<StageId>) -> Result<(), RunError> {
        let mut draft = self.loan()?;
        *draft.header() = header;
        self.put(draft, hop)
    }
}

impl<M> Writer<M> {
    /// Publishes a topic of messages `M`.
    pub fn to(topic: &'static Topic, node: &Node, manifest: &Manifest) -> Result<Self, RunError> {
        let handshake = Listener::open(node, &handshake_event(topic.name))?;
        let data = Notifier::open(node, &data_event(topic.name))?;
        // Last, since a publisher connects to all existing readers at once.
        let service = Service::open(node, topic)?;
        let sizes = (topic.sizes)(&manifest.window);
        let elements = (topic.max_elements)(&manifest.limits);
        let port = service
            .factory
            .publisher_builder()
            .initial_max_slice_len(elements)
            .max_loaned_samples(sizes.loaned)
            // The transport would reserve a queue of samples of its own for each subscriber.
            .override_sample_preallocation(move |_| sizes.samples())
            // Never wait for a slow or dead reader: the window bounds the items in flight.
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|e| RunError::transport(format!("publish {}", topic.name), e))?;
        // The id is the number in the name of its shared memory.
        reserve(manifest, topic.name, port.id().value())?;
        Ok(Self {
            topic: topic.name,
            handshake,
            data,
            header_bytes: topic.header.bytes,
            elements,
            port,
            message: PhantomData,
        })
    }

    /// Loans a message of the longest payload to fill in. The header is zero; the payload is
    /// whatever is in memory.
    pub fn loan(&self) -> Result<Draft<M>, RunError> {
        // SAFETY: the topic's payload is a slice, so that any number of elements may be loaned.
        let sample = unsafe { self.port.loan_custom_payload(self.elements) }
            .map_err(|e| RunError::transport(format!("get memory for {}", self.topic), e))?;
        let mut draft = Draft {
            // SAFETY: any bytes of mapped memory are valid values of bytes.
            sample: unsafe { sample.assume_init() },
            header_bytes: self.header_bytes,
            message: PhantomData,
        };
        draft.bytes().0.fill(0);
        Ok(draft)
    }

    /// Publishes a message without copying: readers receive its offset in shared memory.
    pub fn send(&self, draft: Draft<M>, hop: StageId) -> Result<(), RunError> {
        self.put(draft, Some(hop))
    }

    fn put(&self, mut draft: Draft<M>, hop: Option<StageId>) -> Result<(), RunError> {
        if let Some(hop) = hop {
            draft.item().hop_mut(hop).published_ns = clock::now_ns();
        }
        let sent = draft.sample.send();
        sent.map_err(|e| RunError::transport(format!("send {}", self.topic), e))?;
        self.data.notify()
    }

    pub fn end(&self, item: Item, hop: Option<StageId>) -> Result<(), RunError> {
        let mut draft = self.loan()?;
        *draft.item() = item.flagged(flag::END);
        self.put(draft, hop)
    }

    /// Sends the history to readers that have subscribed since the last call, and wakes them.
    ///
    /// Readers are woken only after a handshake: woken readers answer the handshakes of their own
    /// topics, so unconditional wake-ups would circulate for ever.
    pub fn accept_readers(&self) -> Result<(), RunError> {
        match self.answer_handshakes()? {
            true => Ok(()),
            // After a lost handshake the reader finds the history at the end of its own wait.
            false => self.connect(),
        }
    }

    /// The same for readers that have notified alone; returns whether there were any.
    pub fn answer_handshakes(&self) -> Result<bool, RunError> {
        let new_reader = self.handshake.take()? > 0;
        if new_reader {
            self.connect()?;
            self.data.notify()?;
        }
        Ok(new_reader)
    }

    fn connect(&self) -> Result<(), RunError> {
        self.port
            .update_connections()
            .map_err(|e| RunError::transport(format!("connect the readers of {}", self.topic), e))
    }

    /// Returns the listener that new readers notify.
    pub fn listener(&self) -> &Listener {
        &self.handshake
    }
}

/// Allocates the segment of the publisher with this id. The transport creates segments without
/// memory, and a first write to a page without memory kills the process. A dead process may have
/// left memory that is about to be freed.
fn reserve(manifest: &Manifest, topic: &str, publisher: u128) -> Result<(), RunError> {
    let suffix = format!("_{publisher}.data");
    let (path, segment) = run::own_files(Path::new(SHARED_MEMORY), &manifest.prefix)
        .find(|(path, _)| path.to_string_lossy().ends_with(&suffix))
        .ok_or_else(|| RunError::transport(format!("find the memory of {topic}"), publisher))?;
    let file = File::options().write(true).open(path);
    let allocated = file.and_then(|file| {
        let whole = fallocate(&file, FallocateFlags::empty(), 0, segment.len());
        whole.map_err(Into::into)
    });
    allocated.map_err(|error| {
        RunError::Transient(format!(
            "shared memory at {SHARED_MEMORY} has no room for the {:.1} MB of topic `{topic}` ({error}): free some, enlarge it \
             (containers: --shm-size), or lower run.window or raster.n",
            segment.len() as f64 / 1e6
        ))
    })
}

impl<M> Draft<M> {
    /// Returns the bytes of the header and of the payload.
    fn bytes(&mut self) -> (&mut [u8], &mut [u8]) {
        let header = std::ptr::from_mut(self.sample.user_header_mut()).cast::<u8>();
        let payload = self.sample.payload_mut();
        let (elements, bytes) = (payload.as_mut_ptr().cast::<u8>(), payload.len());
        // SAFETY: the topic was opened with this size of headers, so that the sample has as many
        // bytes there. `loan` has written them. An element of `AnyPayload` is one byte. Header and
        // payload are disjoint parts of a sample that this draft owns.
        unsafe {
            (
                slice::from_raw_parts_mut(header, self.header_bytes),
                slice::from_raw_parts_mut(elements, bytes),
            )
        }
    }

    /// Returns the item of the message's scan, which is at the start of every header.
    fn item(&mut self) -> &mut Item {
        bytemuck::from_bytes_mut(&mut self.bytes().0[..size_of::<Item>()])
    }
}

impl<M: Message> Draft<M> {
    pub fn header(&mut self) -> &mut M::Header {
        bytemuck::from_bytes_mut(self.bytes().0)
    }

    /// Returns the values of the payload: bytes of a scan, cells of a raster.
    pub fn values<T: bytemuck::Pod>(&mut self) -> &mut [T] {
        self.parts().1
    }

    pub fn parts<T: bytemuck::Pod>(&mut self) -> (&mut M::Header, &mut [T]) {
        let (header, payload) = self.bytes();
        (
            bytemuck::from_bytes_mut(header),
            bytemuck::cast_slice_mut(payload),
        )
    }
}

impl TopicWriter {
    /// Publishes a message as it is, without stamping it: of its payload as much as there is room
    /// for.
    pub fn send_unchanged(&self, start: &[u8], payload: &[u8]) -> Result<(), RunError> {
        let mut draft = self.loan()?;
        let (header, room) = draft.bytes();
        if start.len() != header.len() {
            return Err(RunError::Input(format!(
                "a header of {} bytes does not belong to topic `{}`",
                start.len(),
                self.topic
            )));
        }
        header.copy_from_slice(start);
        let length = payload.len().min(room.len());
        room[..length].copy_from_slice(&payload[..length]);
        self.put(draft, None)
    }

    /// Opens topics of the stream for publishing, in the place of the source.
    pub fn of_stream(
        node: &Node,
        manifest: &Manifest,
        topics: &[&str],
    ) -> Result<Vec<Self>, RunError> {
        let of_stream = |topic: &&str| {
            let found = gyre_contract::topic(topic)
                .filter(|it| matches!(it.sender, Sender::Stage(_)) && it.name != Pose::TOPIC);
            let topic = found.ok_or_else(|| {
                let reason = format!("a source does not publish the topic `{topic}`");
                RunError::Input(reason)
            })?;
            Self::to(topic, node, manifest)
        };
        topics.iter().map(of_stream).collect()
    }

    /// Publishes a message with this item, in the place of the source.
    pub fn republish(&self, message: &RecordedMessage, item: Item) -> Result<(), RunError> {
        let mut draft = self.loan()?;
        let (header, payload) = draft.bytes();
        let (bytes, room) = (message.payload.len(), payload.len());
        let is_whole = message.header.len() == header.len();
        let Some(content) = payload.get_mut(..bytes).filter(|_| is_whole) else {
            return Err(RunError::Input(format!(
                "the recorded message {} of topic `{}` has {bytes} bytes, and this run has room for {room}: its configuration differs from the recorded run",
                item.seq, self.topic
            )));
        };
        content.copy_from_slice(&message.payload);
        // The memory behind it has no meaning, and must not differ from run to run.
        payload[bytes..].fill(0);
        header.copy_from_slice(&message.header);
        *draft.item() = item;
        self.send(draft, StageId::RadarReplay)
    }
}

/// Returns the item of the messages of a scan without the times of the run that they are from.
pub fn item_of<'a>(
    messages: impl IntoIterator<Item = &'a RecordedMessage>,
    seq: u64,
) -> Result<Item, RunError> {
    let item = messages.into_iter().next().and_then(RecordedMessage::item);
    match item.filter(|item| item.seq == seq) {
        Some(item) => Ok(Item {
            hops: Default::default(),
            ..item
        }),
        None => Err(RunError::Input(format!(
            "the recorded message {seq} is a different one"
        ))),
    }
}
