//! The subscriber of a topic: the raw queue, or its items in order.

use std::{marker::PhantomData, slice};

use bytemuck::Pod;
use gyre_contract::{Item, Limits, Message, Topic, flag};
use iceoryx2::{
    port::{ReceiveError, port_name::PortName, subscriber::Subscriber},
    sample::Sample,
};

use crate::{
    Manifest, RunError, clock,
    message::RecordedMessage,
    transport::{
        AnyHeader, AnyPayload, Ipc, Listener, Node, Notifier, Service, data_event, handshake_event,
    },
};

type Bytes = Sample<Ipc, AnyPayload, AnyHeader>;

/// A message in shared memory, borrowed from its publisher until it is dropped.
pub struct Received<M> {
    sample: Bytes,
    topic: &'static Topic,
    message: PhantomData<M>,
    /// Time of its removal from the queue, `CLOCK_MONOTONIC`, ns.
    pub received_ns: i64,
}

impl<M: Message> Received<M> {
    pub fn header(&self) -> &M::Header {
        bytemuck::from_bytes(self.header_bytes())
    }
}

impl<M> Received<M> {
    pub fn header_bytes(&self) -> &[u8] {
        let header = std::ptr::from_ref(self.sample.user_header()).cast::<u8>();
        // SAFETY: the topic was opened with this size of headers, so that the sample has as many
        // bytes there, which its publisher does not write any more.
        unsafe { slice::from_raw_parts(header, self.topic.header.bytes) }
    }

    fn payload(&self) -> &[u8] {
        let payload = self.sample.payload();
        // SAFETY: an element of `AnyPayload` is one byte.
        unsafe { slice::from_raw_parts(payload.as_ptr().cast::<u8>(), payload.len()) }
    }

    pub fn item(&self) -> &Item {
        bytemuck::from_bytes(&self.header_bytes()[..size_of::<Item>()])
    }

    /// Returns the values of the payload, in the publisher's memory.
    pub fn values<T: Pod>(&self) -> &[T] {
        bytemuck::cast_slice(self.payload())
    }

    /// Returns a copy of the message outside of shared memory: its header, and what that describes
    /// of its payload.
    pub fn to_bytes(&self) -> RecordedMessage {
        let (header, payload) = (self.header_bytes(), self.payload());
        let content = (self.topic.content_bytes)(header).unwrap_or(payload.len());
        RecordedMessage {
            header: header.to_vec(),
            payload: payload[..content.min(payload.len())].to_vec(),
        }
    }

    pub fn malformed(&self, reason: impl Into<String>) -> RunError {
        RunError::Malformed {
            topic: self.topic.name,
            sender: self.topic.sender.of(self.item()),
            seq: self.item().seq,
            reason: reason.into(),
        }
    }
}

pub struct Port<M> {
    pub topic: &'static Topic,
    limits: Limits,
    is_observer: bool,
    subscriber: Subscriber<Ipc, AnyPayload, AnyHeader>,
    data: Listener,
    message: PhantomData<M>,
}

impl<M: Message> Port<M> {
    /// Subscribes to the topic and notifies its publisher, which answers with its history.
    pub fn open(node: &Node, manifest: &Manifest) -> Result<Self, RunError> {
        Self::to(M::ENTRY, node, manifest)
    }
}

impl<M> Port<M> {
    pub fn to(topic: &'static Topic, node: &Node, manifest: &Manifest) -> Result<Self, RunError> {
        let port = Self::silent(topic, node, manifest)?;
        notify_publisher(node, topic.name)?;
        Ok(port)
    }

    /// Subscribes without notifying the publisher, as no stage may.
    pub fn silent(
        topic: &'static Topic,
        node: &Node,
        manifest: &Manifest,
    ) -> Result<Self, RunError> {
        Self::of(&Service::open(node, topic)?, None, node, manifest)
    }

    /// Subscribes as a process of the run, or as an observer, under a name for counting observers.
    pub fn of(
        service: &Service,
        observer: Option<&str>,
        node: &Node,
        manifest: &Manifest,
    ) -> Result<Self, RunError> {
        let topic = service.topic;
        let mut builder = service.factory.subscriber_builder();
        if let Some(name) = observer {
            let name = PortName::new(name);
            builder = builder.name(&name.map_err(|e| RunError::transport("name the observer", e))?);
        }
        let subscriber = builder
            .create()
            .map_err(|e| RunError::transport(format!("subscribe to {}", topic.name), e))?;
        Ok(Self {
            topic,
            limits: manifest.limits,
            is_observer: observer.is_some(),
            subscriber,
            data: Listener::open(node, &data_event(topic.name))?,
            message: PhantomData,
        })
    }

    /// Receives the next sample; `None` if the queue is empty, or cannot be read now.
    fn sample(&self) -> Result<Option<Bytes>, RunError> {
        match self.subscriber.receive() {
            Ok(sample) => Ok(sample),
            // Samples of a dead publisher are still borrowed. The next call succeeds once they are
            // released.
            Err(ReceiveError::ExceedsMaxBorrows) if !self.is_observer => Ok(None),
            // The publisher has just died or is being restarted. Its next message is found at the
            // next wake-up.
            Err(ReceiveError::ConnectionFailure(_)) if self.is_observer => Ok(None),
            Err(e) => Err(RunError::transport(
                format!("receive {}", self.topic.name),
                e,
            )),
        }
    }

    /// Receives the next message and checks it; `None` if the queue is empty.
    pub fn receive(&self) -> Result<Option<Received<M>>, RunError> {
        let Some(sample) = self.sample()? else {
            return Ok(None);
        };
        let received = Received {
            sample,
            topic: self.topic,
            message: PhantomData,
            received_ns: clock::now_ns(),
        };
        match (self.topic.check)(received.header_bytes(), received.payload(), &self.limits) {
            Ok(()) => Ok(Some(received)),
            Err(violation) => Err(received.malformed(violation)),
        }
    }

    pub fn listener(&self) -> &Listener {
        &self.data
    }
}

/// Notifies the publisher of a topic, which then connects to its new readers.
pub fn notify_publisher(node: &Node, topic: &str) -> Result<(), RunError> {
    Notifier::open(node, &handshake_event(topic))?.notify()
}

/// The items of a topic in order, each once: the current and the previous one.
pub struct Reader<M> {
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
    pub fn open(node: &Node, manifest: &Manifest, next: Option<u64>) -> Result<Self, RunError> {
        Ok(Self::of(Port::open(node, manifest)?, next))
    }
}

impl<M> Reader<M> {
    pub fn of(port: Port<M>, next: Option<u64>) -> Self {
        Self {
            port,
            next,
            head: None,
            previous: None,
            duplicates: 0,
        }
    }

    /// Returns the current item and receives it first if necessary. Duplicates are skipped.
    pub fn head(&mut self) -> Result<Option<&Received<M>>, RunError> {
        while self.head.is_none() {
            let Some(received) = self.port.receive()? else {
                break;
            };
            let got = received.item().seq;
            match self.next {
                Some(next) if got < next => self.duplicates += 1,
                Some(next) if got > next => {
                    return Err(RunError::gap(self.port.topic.name, next, got));
                }
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
        let follows = head.item().seq.checked_sub(1) == Some(previous.item().seq);
        (follows && !head.item().is(flag::BREAK)).then_some(previous)
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
    pub fn take_bytes(&mut self) -> Result<Option<RecordedMessage>, RunError> {
        let message = self.head()?.map(Received::to_bytes);
        self.release();
        Ok(message)
    }

    pub fn listener(&self) -> &Listener {
        self.port.listener()
    }
}
