//! The observer of a topic that is known by its name, whose messages are taken as bytes.

use std::time::Duration;

use gyre_messages::{
    Correction, Fix, GivenAnew, Item, Loop, Masked, Message, Motion, Objects, Pose, Refined,
    Rotation, Scan,
};

use super::{Next, ObservedRun, Observer};
use crate::{Listener, StageError, outlet::RecordedMessage};

/// The observer of a topic, whatever its type.
pub trait TopicObserver {
    fn topic(&self) -> &'static str;

    /// Takes the next message that is there; `None` without a message. A message that breaks its
    /// contract is an error and counts as missed.
    fn take(&mut self) -> Result<Option<RecordedMessage>, StageError>;

    /// Returns whether the end of the stream or of the run has been taken.
    fn has_ended(&self) -> bool;

    /// See [`Observer::listener`].
    fn listener(&self) -> &Listener;

    /// See [`Observer::expect`].
    fn expect(&mut self, next: u64, generation: u32);

    /// See [`Observer::missed`].
    fn missed(&self) -> u64;

    /// See [`Observer::skipped`].
    fn skipped(&self, known: u32, item: &Item) -> Result<Option<GivenAnew>, StageError>;
}

struct Typed<'run, M: Message> {
    observer: Observer<'run, M>,
    has_ended: bool,
}

impl ObservedRun {
    /// Subscribes to the topic of this name; `None` for an unknown topic.
    pub fn observe_topic(
        &self,
        topic: &str,
    ) -> Result<Option<Box<dyn TopicObserver + '_>>, StageError> {
        Ok(Some(match topic {
            Scan::TOPIC => self.typed::<Scan>()?,
            Masked::TOPIC => self.typed::<Masked>()?,
            Rotation::TOPIC => self.typed::<Rotation>()?,
            Motion::TOPIC => self.typed::<Motion>()?,
            Refined::TOPIC => self.typed::<Refined>()?,
            Pose::TOPIC => self.typed::<Pose>()?,
            Loop::TOPIC => self.typed::<Loop>()?,
            Correction::TOPIC => self.typed::<Correction>()?,
            Fix::TOPIC => self.typed::<Fix>()?,
            Objects::TOPIC => self.typed::<Objects>()?,
            _ => return Ok(None),
        }))
    }

    fn typed<M: Message>(&self) -> Result<Box<dyn TopicObserver + '_>, StageError> {
        Ok(Box::new(Typed {
            observer: self.observe::<M>()?,
            has_ended: false,
        }))
    }
}

impl<M: Message> TopicObserver for Typed<'_, M> {
    fn topic(&self) -> &'static str {
        M::TOPIC
    }

    fn take(&mut self) -> Result<Option<RecordedMessage>, StageError> {
        let next = self.observer.next(Duration::ZERO)?;
        // After the end of the stream masking may still be killed, and reuse numbers.
        self.has_ended = matches!(next, Next::Ended);
        Ok(match next {
            Next::Message(message, _) => Some(message.to_bytes()),
            Next::Idle | Next::Ended => None,
        })
    }

    fn has_ended(&self) -> bool {
        self.has_ended
    }

    fn listener(&self) -> &Listener {
        self.observer.listener()
    }

    fn expect(&mut self, next: u64, generation: u32) {
        self.observer.expect(next, generation);
    }

    fn missed(&self) -> u64 {
        self.observer.missed()
    }

    fn skipped(&self, known: u32, item: &Item) -> Result<Option<GivenAnew>, StageError> {
        self.observer.skipped(known, item)
    }
}
