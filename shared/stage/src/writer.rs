//! The publishing end of a topic.

use gyre_messages::{Header, Message, StageId};
use iceoryx2::{
    port::{publisher::Publisher, update_connections::UpdateConnections},
    prelude::BackpressureStrategy,
    sample_mut::SampleMut,
};

use crate::{
    Manifest, StageError, clock,
    services::{self, Ipc, Listener, Node, Notifier},
};

/// Publishes a topic's messages. What it sent last is kept for readers that come later, see [`Writer::accept_readers`].
pub struct Writer<M: Message> {
    handshake: Listener,
    data: Notifier,
    publisher: Publisher<Ipc, [M::Element], M::Header>,
    elements: usize,
}

/// A message being written, where its readers will find it.
pub struct Draft<M: Message> {
    sample: SampleMut<Ipc, [M::Element], M::Header>,
}

impl<M: Message> Writer<M> {
    /// Opens the topic for publishing.
    pub(crate) fn open(node: &Node, manifest: &Manifest) -> Result<Self, StageError> {
        let handshake = services::listener(node, &services::handshake_event(M::TOPIC))?;
        let data = services::notifier(node, &services::data_event(M::TOPIC))?;
        let elements = M::max_elements(&manifest.limits);
        // Last, for a publisher connects at once to all readers there are.
        let publisher = services::open_topic::<M>(node)?
            .publisher_builder()
            .initial_max_slice_len(elements)
            .max_loaned_samples(M::sizes(&manifest.window).loaned)
            // Never wait for a slow or dead reader: the window bounds what is in flight.
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|e| StageError::transport(format!("publish {}", M::TOPIC), e))?;
        Ok(Self {
            handshake,
            data,
            publisher,
            elements,
        })
    }

    /// Lends a message to fill: its header is the default, its payload is whatever the memory holds.
    pub fn loan(&self) -> Result<Draft<M>, StageError> {
        let sample = self
            .publisher
            .loan_slice_uninit(self.elements)
            .map_err(|e| StageError::transport(format!("get memory for {}", M::TOPIC), e))?;
        // SAFETY: the elements are `Pod`, so any bytes that mapped memory holds are valid values.
        Ok(Draft {
            sample: unsafe { sample.assume_init() },
        })
    }

    /// Publishes a message. The transport copies nothing: readers get its place in shared memory.
    pub fn send(&self, mut draft: Draft<M>, hop: StageId) -> Result<(), StageError> {
        let item = draft.header().item_mut();
        item.pid = std::process::id();
        item.hop(hop).published_ns = clock::now_ns();
        draft
            .sample
            .send()
            .map_err(|e| StageError::transport(format!("send {}", M::TOPIC), e))?;
        self.notify()
    }

    /// Hands the history to readers that have come since the last call, and wakes them.
    ///
    /// Readers are woken only where a new one has come: readers that are woken answer handshakes of their own topics, so
    /// wake-ups would circulate for ever.
    pub fn accept_readers(&self) -> Result<(), StageError> {
        let mut new_reader = false;
        self.handshake
            .try_wait(|_| new_reader = true)
            .map_err(|e| StageError::transport(format!("hear the readers of {}", M::TOPIC), e))?;
        // In any case: a handshake can be lost, and its reader then finds the history when its own wait ends.
        self.publisher.update_connections().map_err(|e| {
            StageError::transport(format!("connect the readers of {}", M::TOPIC), e)
        })?;
        if new_reader { self.notify() } else { Ok(()) }
    }

    /// What new readers notify.
    pub(crate) fn listener(&self) -> &Listener {
        &self.handshake
    }

    fn notify(&self) -> Result<(), StageError> {
        self.data
            .notify()
            .map_err(|e| StageError::transport(format!("wake the readers of {}", M::TOPIC), e))?;
        Ok(())
    }
}

impl<M: Message> Draft<M> {
    /// The header.
    pub fn header(&mut self) -> &mut M::Header {
        self.sample.user_header_mut()
    }

    /// The payload's values: bytes of a scan, cells of a raster.
    pub fn values<T: bytemuck::Pod>(&mut self) -> &mut [T] {
        bytemuck::cast_slice_mut(self.sample.payload_mut())
    }

    /// Header and payload at once.
    pub fn parts<T: bytemuck::Pod>(&mut self) -> (&mut M::Header, &mut [T]) {
        // SAFETY: header and payload are separate parts of one sample that this draft owns alone.
        let header: *mut M::Header = self.sample.user_header_mut();
        (
            unsafe { &mut *header },
            bytemuck::cast_slice_mut(self.sample.payload_mut()),
        )
    }
}
