//! The receiving end of a topic: raw, or in order.

use bytemuck::Pod;
use gyre_messages::{Header, Item, Message};
use iceoryx2::{
    port::{ReceiveError, subscriber::Subscriber},
    sample::Sample,
};

use crate::{
    Launch, StageError, clock,
    services::{self, Ipc, Listener, Node, Notifier},
};

/// A message in shared memory, borrowed from its publisher until this is dropped.
pub struct Received<M: Message> {
    sample: Sample<Ipc, [M::Element], M::Header>,
    /// When it was taken from the queue, `CLOCK_MONOTONIC`, ns.
    pub received_ns: i64,
}

impl<M: Message> Received<M> {
    /// The header.
    pub fn header(&self) -> &M::Header {
        self.sample.user_header()
    }

    /// Which scan this is about.
    pub fn item(&self) -> &Item {
        self.header().item()
    }

    /// The payload's values, where the publisher wrote them.
    pub fn values<T: Pod>(&self) -> &[T] {
        bytemuck::cast_slice(self.sample.payload())
    }

    /// An error that names this message.
    pub fn malformed(&self, reason: impl Into<String>) -> StageError {
        StageError::Malformed {
            topic: M::TOPIC,
            seq: self.item().seq,
            reason: reason.into(),
        }
    }
}

/// A topic's queue as it comes.
pub struct Port<M: Message> {
    subscriber: Subscriber<Ipc, [M::Element], M::Header>,
    data: Listener,
    _handshake: Notifier,
}

impl<M: Message> Port<M> {
    /// Opens the topic of a run for reading and notifies its publisher, which answers with its history.
    ///
    /// # Errors
    /// A failure of the transport.
    pub fn open(launch: &Launch) -> Result<Self, StageError> {
        Self::on(&launch.node)
    }

    pub(crate) fn on(node: &Node) -> Result<Self, StageError> {
        let subscriber = services::open_topic::<M>(node)?
            .subscriber_builder()
            .create()
            .map_err(|e| StageError::transport(format!("subscribe to {}", M::TOPIC), e))?;
        let data = services::listener(node, &services::data_event(M::TOPIC))?;
        let handshake = services::notifier(node, &services::handshake_event(M::TOPIC))?;
        handshake.notify().map_err(|e| {
            StageError::transport(format!("notify the publisher of {}", M::TOPIC), e)
        })?;
        Ok(Self {
            subscriber,
            data,
            _handshake: handshake,
        })
    }

    /// The next message in the queue.
    pub fn receive(&self) -> Result<Option<Received<M>>, StageError> {
        match self.subscriber.receive() {
            Ok(sample) => Ok(sample.map(|sample| Received {
                sample,
                received_ns: clock::now_ns(),
            })),
            // Samples of a dead publisher are still borrowed: some are released first, then this is tried again.
            Err(ReceiveError::ExceedsMaxBorrows) => Ok(None),
            Err(error) => Err(StageError::transport(
                format!("receive {}", M::TOPIC),
                error,
            )),
        }
    }

    /// What the publisher notifies.
    pub fn listener(&self) -> &Listener {
        &self.data
    }
}

/// A topic's items in their order, each once: the one at hand and the one before it.
pub struct Reader<M: Message> {
    port: Port<M>,
    next: Option<u64>,
    head: Option<Received<M>>,
    before: Option<Received<M>>,
    duplicates: u64,
}

impl<M: Message> Reader<M> {
    /// Opens the topic; `next` is the first item wanted, or whatever comes first.
    ///
    /// # Errors
    /// A failure of the transport.
    pub fn open(launch: &Launch, next: Option<u64>) -> Result<Self, StageError> {
        Self::on(&launch.node, next)
    }

    pub(crate) fn on(node: &Node, next: Option<u64>) -> Result<Self, StageError> {
        Ok(Self {
            port: Port::on(node)?,
            next,
            head: None,
            before: None,
            duplicates: 0,
        })
    }

    /// The item at hand, taken from the queue if need be. Items that were had before are skipped;
    /// a missing one is an error, since queues are sized so that none can be lost.
    pub fn head(&mut self) -> Result<Option<&Received<M>>, StageError> {
        while self.head.is_none() {
            let Some(received) = self.port.receive()? else {
                break;
            };
            let got = received.item().seq;
            match self.next {
                Some(next) if got < next => self.duplicates += 1,
                Some(next) if got > next => {
                    return Err(StageError::SequenceGap {
                        topic: M::TOPIC,
                        expected: next,
                        got,
                    });
                }
                _ => self.head = Some(received),
            }
        }
        Ok(self.head.as_ref())
    }

    /// The item at hand, if it has been taken from the queue.
    pub fn current(&self) -> Option<&Received<M>> {
        self.head.as_ref()
    }

    /// The item before the one at hand, while the chain is unbroken.
    pub fn before(&self) -> Option<&Received<M>> {
        let (before, head) = (self.before.as_ref()?, self.head.as_ref()?);
        let follows = head.item().seq.checked_sub(1) == Some(before.item().seq)
            && !head.item().is(gyre_messages::flag::BREAK);
        follows.then_some(before)
    }

    /// Done with the item at hand: it becomes the one before.
    pub fn advance(&mut self) {
        if let Some(head) = self.head.take() {
            self.next = Some(head.item().seq.saturating_add(1));
            self.before = Some(head);
        }
    }

    /// Done with the item at hand, and nobody will ask for it as the one before.
    pub fn release(&mut self) {
        self.advance();
        self.before = None;
    }

    /// Items skipped because they had been had before.
    pub fn duplicates(&self) -> u64 {
        self.duplicates
    }

    /// What the publisher notifies.
    pub fn listener(&self) -> &Listener {
        self.port.listener()
    }
}
