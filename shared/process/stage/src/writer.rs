//! The publisher of a topic.

use gyre_messages::{Header, Message, StageId};
use iceoryx2::{
    port::{publisher::Publisher, update_connections::UpdateConnections},
    prelude::BackpressureStrategy,
    sample_mut::SampleMut,
};

use crate::{
    Manifest, StageError, clock, reservation,
    services::{self, Ipc, Listener, Node, Notifier},
};

/// Publishes the messages of a topic and keeps a history for late readers: see [`Writer::accept_readers`].
pub struct Writer<M: Message> {
    handshake: Listener,
    data: Notifier,
    publisher: Publisher<Ipc, [M::Element], M::Header>,
    elements: usize,
}

/// A message that is being written in shared memory.
pub struct Draft<M: Message> {
    sample: SampleMut<Ipc, [M::Element], M::Header>,
}

impl<M: Message> Writer<M> {
    /// Opens the topic for publishing.
    ///
    /// # Errors
    /// A failure of the transport.
    pub fn open(node: &Node, manifest: &Manifest) -> Result<Self, StageError> {
        let handshake = services::listener(node, &services::handshake_event(M::TOPIC))?;
        let data = services::notifier(node, &services::data_event(M::TOPIC))?;
        let elements = M::max_elements(&manifest.limits);
        let sizes = M::sizes(&manifest.window);
        // Last, since a publisher connects to all existing readers at once.
        let publisher = services::open_topic::<M>(node)?
            .publisher_builder()
            .initial_max_slice_len(elements)
            .max_loaned_samples(sizes.loaned)
            // The transport would reserve a queue of samples of its own for each subscriber.
            .override_sample_preallocation(move |_| sizes.samples())
            // Never wait for a slow or dead reader: the window bounds the items in flight.
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|e| StageError::transport(format!("publish {}", M::TOPIC), e))?;
        reservation::reserve(manifest, M::TOPIC, publisher.id().value())?;
        Ok(Self {
            handshake,
            data,
            publisher,
            elements,
        })
    }

    /// Loans a message to fill in. The header is the default; the payload is uninitialised.
    ///
    /// # Errors
    /// A failure of the transport.
    pub fn loan(&self) -> Result<Draft<M>, StageError> {
        let sample = self
            .publisher
            .loan_slice_uninit(self.elements)
            .map_err(|e| StageError::transport(format!("get memory for {}", M::TOPIC), e))?;
        // SAFETY: the elements are `Pod`, so any bytes of mapped memory are valid values.
        Ok(Draft {
            sample: unsafe { sample.assume_init() },
        })
    }

    /// Publishes a message without copying: readers receive its offset in shared memory.
    ///
    /// # Errors
    /// A failure of the transport.
    pub fn send(&self, mut draft: Draft<M>, hop: StageId) -> Result<(), StageError> {
        let item = draft.header().item_mut();
        item.hop_mut(hop).published_ns = clock::now_ns();
        self.publish(draft)
    }

    /// The same for a process that is not in the stream and has no hop.
    pub(crate) fn publish(&self, mut draft: Draft<M>) -> Result<(), StageError> {
        draft.header().item_mut().pid = std::process::id();
        self.send_unchanged(draft)
    }

    /// Publishes a message that says of itself who has sent it.
    ///
    /// # Errors
    /// A failure of the transport.
    pub fn send_unchanged(&self, draft: Draft<M>) -> Result<(), StageError> {
        draft
            .sample
            .send()
            .map_err(|e| StageError::transport(format!("send {}", M::TOPIC), e))?;
        self.notify()
    }

    /// Sends the history to readers that have subscribed since the last call, and wakes them.
    ///
    /// Readers are woken only after a handshake: woken readers answer the handshakes of their own topics, so unconditional
    /// wake-ups would circulate for ever.
    ///
    /// # Errors
    /// A failure of the transport.
    pub fn accept_readers(&self) -> Result<(), StageError> {
        let new_reader = self.has_new_reader()?;
        // Unconditionally: after a lost handshake the reader finds the history at the end of its own wait.
        self.connect()?;
        if new_reader { self.notify() } else { Ok(()) }
    }

    /// The same for readers that have notified alone; returns whether there were any.
    ///
    /// # Errors
    /// A failure of the transport.
    pub fn answer_handshakes(&self) -> Result<bool, StageError> {
        let new_reader = self.has_new_reader()?;
        if new_reader {
            self.connect()?;
            self.notify()?;
        }
        Ok(new_reader)
    }

    fn has_new_reader(&self) -> Result<bool, StageError> {
        let mut new_reader = false;
        self.handshake
            .try_wait(|_| new_reader = true)
            .map_err(|e| {
                StageError::transport(format!("read the handshakes of {}", M::TOPIC), e)
            })?;
        Ok(new_reader)
    }

    fn connect(&self) -> Result<(), StageError> {
        self.publisher
            .update_connections()
            .map_err(|e| StageError::transport(format!("connect the readers of {}", M::TOPIC), e))
    }

    /// Returns the listener that new readers notify.
    pub fn listener(&self) -> &Listener {
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
    /// Returns the header.
    pub fn header(&mut self) -> &mut M::Header {
        self.sample.user_header_mut()
    }

    /// Returns the values of the payload: bytes of a scan, cells of a raster.
    pub fn values<T: bytemuck::Pod>(&mut self) -> &mut [T] {
        bytemuck::cast_slice_mut(self.sample.payload_mut())
    }

    /// Returns header and payload.
    pub fn parts<T: bytemuck::Pod>(&mut self) -> (&mut M::Header, &mut [T]) {
        // SAFETY: header and payload are disjoint parts of a sample that this draft owns.
        let header: *mut M::Header = self.sample.user_header_mut();
        (
            unsafe { &mut *header },
            bytemuck::cast_slice_mut(self.sample.payload_mut()),
        )
    }
}
