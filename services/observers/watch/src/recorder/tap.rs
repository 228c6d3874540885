//! The observers of the topics that are recorded.

use gyre_client::{Listener, RecordedMessage, Run, RunError, TopicObserver, clock};
use gyre_contract::{Topic, Use};
use gyre_recording::{Incoming, Position};

use crate::recorder::queue::{Entry, Sender};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counts {
    pub topic: &'static str,
    pub recorded: u64,
    /// Messages that were overwritten before they were taken, did not fit into the queue, or were
    /// malformed; and those between the parts before and this recorder.
    pub missed: u64,
}

pub(crate) struct Tap {
    topic: &'static Topic,
    observer: TopicObserver,
    recorded: u64,
    dropped: u64,
    reported: u64,
    generation: u32,
}

impl Tap {
    /// Observes a topic. Messages from the position `expected` on are to be recorded, if it is
    /// known: those before are in earlier parts.
    pub(crate) fn on(
        run: &Run,
        topic: &'static Topic,
        expected: Option<Position>,
    ) -> Result<Self, RunError> {
        let mut observer = run.observe_topic(topic)?;
        if let Some(Position { next, generation }) = expected {
            observer.expect(next, generation);
        }
        let generation = expected.unwrap_or_default().generation;
        Ok(Self {
            topic,
            observer,
            recorded: 0,
            dropped: 0,
            reported: 0,
            generation,
        })
    }

    fn missed(&self) -> u64 {
        let overwritten = match self.topic.is(Use::Replaces) {
            true => 0,
            false => self.observer.missed(),
        };
        overwritten + self.dropped
    }

    pub(crate) fn drain(&mut self, queue: &Sender) -> Result<(), RunError> {
        loop {
            match self.observer.take() {
                Ok(Some(message)) => self.put(message, queue)?,
                Ok(None) => break,
                // The stages judge the messages of another program. The next message reports the
                // gap.
                Err(error @ RunError::Malformed { .. }) => {
                    tracing::warn!("not recorded: {error}");
                }
                Err(error) => return Err(error),
            }
        }
        let missed = self.missed();
        if self.has_ended()
            && missed > self.reported
            && queue.put(Entry::Missed(self.observer.topic(), missed - self.reported))
        {
            self.reported = missed;
        }
        Ok(())
    }

    fn put(&mut self, message: RecordedMessage, queue: &Sender) -> Result<(), RunError> {
        let missed = self.missed();
        let item = message.item().unwrap_or_default();
        let incoming = Incoming {
            topic: self.observer.topic(),
            header: message.header,
            payload: message.payload,
            received_ns: clock::since_1970_ns(),
            missed: missed - self.reported,
            skipped: self.observer.skipped(self.generation, &item)?,
        };
        match queue.put(Entry::Message(incoming)) {
            true => {
                (self.recorded, self.reported) = (self.recorded + 1, missed);
                self.generation = self.generation.max(item.generation);
            }
            false => self.dropped += 1,
        }
        Ok(())
    }

    pub(crate) fn listener(&self) -> &Listener {
        self.observer.listener()
    }

    pub(crate) fn counts(&self) -> Counts {
        Counts {
            topic: self.observer.topic(),
            recorded: self.recorded,
            missed: self.missed(),
        }
    }

    pub(crate) fn has_ended(&self) -> bool {
        self.observer.has_ended()
    }
}
