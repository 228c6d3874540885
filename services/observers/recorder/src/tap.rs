//! The observers of the topics that are recorded.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use gyre_messages::{
    Correction, Fix, Loop, Masked, Message, Motion, Pose, Refined, Rotation, Scan,
};
use gyre_recording::Incoming;
use gyre_stage::{
    Listener, StageError,
    observer::{Next, ObservedRun, Observer},
    reader::Received,
    source::RecordedMessage,
};

use crate::queue::{Entry, Sender};

/// An observer of a topic, whatever its type.
pub(crate) trait Tap {
    /// Puts the messages that are there into the queue.
    fn drain(&mut self, queue: &Sender) -> Result<(), StageError>;
    /// The listener that the publisher notifies.
    fn listener(&self) -> &Listener;
    /// Messages received and missed so far.
    fn counts(&self) -> Counts;
    /// Whether the stream has ended.
    fn has_ended(&self) -> bool;
}

/// The messages of a topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counts {
    /// The topic.
    pub topic: &'static str,
    /// Messages that were put into the queue.
    pub recorded: u64,
    /// Messages that were overwritten before they were taken, did not fit into the queue, or were malformed; and those between the
    /// parts before and this recorder.
    pub missed: u64,
}

struct TopicTap<'run, M: Message> {
    observer: Observer<'run, M>,
    recorded: u64,
    /// Messages that did not fit into the queue.
    dropped: u64,
    /// Messages that the writer has been told are missed.
    told: u64,
    has_ended: bool,
}

/// Observes a topic by its name; `None` if there is no such topic. Messages from number `expected` on are to be recorded, if it is
/// known: those before are in earlier parts.
pub(crate) fn tap<'run>(
    run: &'run ObservedRun,
    topic: &str,
    expected: Option<u64>,
) -> Option<Result<Box<dyn Tap + 'run>, StageError>> {
    Some(match topic {
        Scan::TOPIC => TopicTap::<Scan>::on(run, expected),
        Masked::TOPIC => TopicTap::<Masked>::on(run, expected),
        Rotation::TOPIC => TopicTap::<Rotation>::on(run, expected),
        Motion::TOPIC => TopicTap::<Motion>::on(run, expected),
        Refined::TOPIC => TopicTap::<Refined>::on(run, expected),
        Pose::TOPIC => TopicTap::<Pose>::on(run, expected),
        Loop::TOPIC => TopicTap::<Loop>::on(run, expected),
        Correction::TOPIC => TopicTap::<Correction>::on(run, expected),
        Fix::TOPIC => TopicTap::<Fix>::on(run, expected),
        _ => return None,
    })
}

impl<'run, M: Message> TopicTap<'run, M> {
    fn on(
        run: &'run ObservedRun,
        expected: Option<u64>,
    ) -> Result<Box<dyn Tap + 'run>, StageError> {
        let mut observer = run.observe::<M>()?;
        if let Some(next) = expected {
            observer.expect(next);
        }
        Ok(Box::new(Self {
            observer,
            recorded: 0,
            dropped: 0,
            told: 0,
            has_ended: false,
        }))
    }

    fn missed(&self) -> u64 {
        // The numbers of corrections count what they are made of, and each replaces those before.
        let overwritten = match M::TOPIC {
            Correction::TOPIC => 0,
            _ => self.observer.missed(),
        };
        overwritten + self.dropped
    }
}

impl<M: Message> Tap for TopicTap<'_, M> {
    fn drain(&mut self, queue: &Sender) -> Result<(), StageError> {
        while !self.has_ended {
            match self.observer.next(Duration::ZERO) {
                Ok(Next::Message(message, _)) => {
                    let mut incoming = incoming(message);
                    let missed = self.missed();
                    incoming.missed = missed - self.told;
                    match queue.put(Entry::Message(incoming)) {
                        true => (self.recorded, self.told) = (self.recorded + 1, missed),
                        false => self.dropped += 1,
                    }
                }
                Ok(Next::Idle) => break,
                Ok(Next::Ended) => self.has_ended = true,
                // The stages judge what another program has sent. The next message tells that this one is missing.
                Err(error @ StageError::Malformed { .. }) => {
                    tracing::warn!("not recorded: {error}")
                }
                Err(error) => return Err(error),
            }
        }
        let missed = self.missed();
        if self.has_ended
            && missed > self.told
            && queue.put(Entry::Missed(M::TOPIC, missed - self.told))
        {
            self.told = missed;
        }
        Ok(())
    }

    fn listener(&self) -> &Listener {
        self.observer.listener()
    }

    fn counts(&self) -> Counts {
        Counts {
            topic: M::TOPIC,
            recorded: self.recorded,
            missed: self.missed(),
        }
    }

    fn has_ended(&self) -> bool {
        self.has_ended
    }
}

fn incoming<M: Message>(message: &Received<M>) -> Incoming {
    let RecordedMessage { header, payload } = message.to_bytes();
    Incoming {
        topic: M::TOPIC,
        header,
        payload,
        received_ns: now_ns(),
        missed: 0,
    }
}

/// Returns the time of the machine, ns since 1970.
pub fn now_ns() -> i64 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    now.map_or(0, |now| now.as_nanos() as i64)
}
