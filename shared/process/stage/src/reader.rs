//! The subscriber of a topic: the raw queue, or its items in order.

use std::marker::PhantomData;

use bytemuck::Pod;
use gyre_messages::{Header, Item, Limits, Message, Topic};

use crate::{
    Launch, Manifest, StageError, clock, services,
    transport::{Listener, Node, Notifier, Sample, Service, Subscriber},
    writer::RecordedMessage,
};

/// A message in shared memory, borrowed from its publisher until it is dropped.
pub struct Received<M: Message> {
    sample: Sample,
    message: PhantomData<M>,
    /// Time of its removal from the queue, `CLOCK_MONOTONIC`, ns.
    pub received_ns: i64,
}

impl<M: Message> Received<M> {
    pub(crate) fn checked(sample: Sample, limits: &Limits) -> Result<Self, StageError> {
        let received = Self {
            sample,
            message: PhantomData,
            received_ns: clock::now_ns(),
        };
        match M::check(received.header(), received.values(), limits) {
            Ok(()) => Ok(received),
            Err(violation) => Err(received.malformed(violation.to_string())),
        }
    }

    pub fn header(&self) -> &M::Header {
        bytemuck::from_bytes(self.sample.header())
    }

    pub fn item(&self) -> &Item {
        self.header().item()
    }

    /// Returns the values of the payload, in the publisher's memory.
    pub fn values<T: Pod>(&self) -> &[T] {
        bytemuck::cast_slice(self.sample.payload())
    }

    /// Returns a copy of the message outside of shared memory: its header, and what that describes
    /// of its payload.
    pub fn to_bytes(&self) -> RecordedMessage {
        let bytes = self.values::<u8>();
        let content = M::content_bytes(self.header()).unwrap_or(bytes.len());
        RecordedMessage {
            header: bytemuck::bytes_of(self.header()).to_vec(),
            payload: bytes[..content.min(bytes.len())].to_vec(),
        }
    }

    pub fn malformed(&self, reason: impl Into<String>) -> StageError {
        StageError::Malformed {
            topic: M::TOPIC,
            sender: M::SENDER.of(self.item()),
            seq: self.item().seq,
            reason: reason.into(),
        }
    }
}

pub struct Port<M: Message> {
    limits: Limits,
    subscriber: Subscriber,
    data: Listener,
    message: PhantomData<M>,
}

impl<M: Message> Port<M> {
    /// Subscribes to the topic and notifies its publisher, which answers with its history.
    pub fn open(launch: &Launch) -> Result<Self, StageError> {
        Self::on(&launch.node, &launch.manifest)
    }

    /// Subscribes as a process that is no stage.
    pub fn on(node: &Node, manifest: &Manifest) -> Result<Self, StageError> {
        let port = Self::silent(node, manifest)?;
        notify_publisher(node, M::TOPIC)?;
        Ok(port)
    }

    /// Subscribes without notifying the publisher, as no stage may.
    pub fn silent(node: &Node, manifest: &Manifest) -> Result<Self, StageError> {
        let service = Service::open(node, &Topic::of::<M>())?;
        Ok(Self {
            limits: manifest.limits,
            subscriber: Subscriber::create(&service, None)?,
            data: Listener::open(node, &services::data_event(M::TOPIC))?,
            message: PhantomData,
        })
    }

    /// Receives the next message and checks it; `None` if the queue is empty.
    pub fn receive(&self) -> Result<Option<Received<M>>, StageError> {
        let sample = self.subscriber.receive()?;
        sample
            .map(|sample| Received::checked(sample, &self.limits))
            .transpose()
    }

    pub fn listener(&self) -> &Listener {
        &self.data
    }
}

/// Notifies the publisher of a topic, which then connects to its new readers.
pub(crate) fn notify_publisher(node: &Node, topic: &str) -> Result<(), StageError> {
    Notifier::open(node, &services::handshake_event(topic))?.notify()
}

/// The items of a topic in order, each once: the current and the previous one.
pub struct Reader<M: Message> {
    port: Port<M>,
    next: Option<u64>,
    head: Option<Received<M>>,
    previous: Option<Received<M>>,
    /// Items that were skipped because they had been received before.
    pub duplicates: u64,
}

impl<M: Message> Reader<M> {
    /// Subscribes to the topic. `next` is the first item wanted; `None` takes whichever arrives
    /// first.
    pub fn open(launch: &Launch, next: Option<u64>) -> Result<Self, StageError> {
        Self::on(&launch.node, &launch.manifest, next)
    }

    pub(crate) fn on(
        node: &Node,
        manifest: &Manifest,
        next: Option<u64>,
    ) -> Result<Self, StageError> {
        Ok(Self {
            port: Port::on(node, manifest)?,
            next,
            head: None,
            previous: None,
            duplicates: 0,
        })
    }

    /// Returns the current item and receives it first if necessary. Duplicates are skipped.
    pub fn head(&mut self) -> Result<Option<&Received<M>>, StageError> {
        while self.head.is_none() {
            let Some(received) = self.port.receive()? else {
                break;
            };
            let got = received.item().seq;
            match self.next {
                Some(next) if got < next => self.duplicates += 1,
                Some(next) if got > next => return Err(StageError::gap(M::TOPIC, next, got)),
                _ => self.head = Some(received),
            }
        }
        Ok(self.head.as_ref())
    }

    pub fn current(&self) -> Option<&Received<M>> {
        self.head.as_ref()
    }

    /// Returns the previous item if the chain is unbroken.
    pub fn previous(&self) -> Option<&Received<M>> {
        let (previous, head) = (self.previous.as_ref()?, self.head.as_ref()?);
        let follows = head.item().seq.checked_sub(1) == Some(previous.item().seq)
            && !head.item().is(gyre_messages::flag::BREAK);
        follows.then_some(previous)
    }

    pub fn advance(&mut self) {
        if let Some(head) = self.head.take() {
            self.next = Some(head.item().seq.saturating_add(1));
            self.previous = Some(head);
        }
    }

    /// Releases the current item without keeping it as the previous one.
    pub fn release(&mut self) {
        self.advance();
        self.previous = None;
    }

    /// Takes the next item out of shared memory; `None` if nothing has arrived yet.
    pub(crate) fn take_bytes(&mut self) -> Result<Option<RecordedMessage>, StageError> {
        let message = self.head()?.map(Received::to_bytes);
        self.release();
        Ok(message)
    }

    pub fn listener(&self) -> &Listener {
        self.port.listener()
    }
}
