//! The observer of a topic that is known by its name, whose messages are taken as bytes.

use std::time::Duration;

use gyre_messages::{
    Correction, Fix, GivenAnew, Item, Loop, Masked, Message, Motion, Objects, Pose, Refined,
    Rotation, Scan,
};

use super::{Next, ObservedRun, Observer};
use crate::{Listener, StageError, writer::RecordedMessage};

pub trait TopicObserver {
    fn topic(&self) -> &'static str;

    /// Takes the next message that is there; `None` without a message. A message that breaks its
    /// contract is an error and counts as missed.
    fn take(&mut self) -> Result<Option<RecordedMessage>, StageError>;

    /// Returns whether the end of the stream or of the run has been taken.
    fn has_ended(&self) -> bool;

    /// Returns the listener that the publisher notifies: see
    /// [`wait_for_any`](super::wait_for_any).
    fn listener(&self) -> &Listener;

    /// Counts as missed all items between `next` and the first received item: all before it is
    /// known already, as from an observer that was there earlier, whose newest item had this
    /// generation.
    fn expect(&mut self, next: u64, generation: u32);

    fn missed(&self) -> u64;

    /// Returns, among the generations after `known` and before the item's, the one that reused the
    /// smallest number.
    fn skipped(&self, known: u32, item: &Item) -> Result<Option<GivenAnew>, StageError>;
}

impl ObservedRun {
    /// Subscribes to the topic of this name; `None` for an unknown topic.
    pub fn observe_topic(
        &self,
        topic: &str,
    ) -> Result<Option<Box<dyn TopicObserver + '_>>, StageError> {
        let observer: Box<dyn TopicObserver + '_> = match topic {
            Scan::TOPIC => Box::new(self.observe::<Scan>()?),
            Masked::TOPIC => Box::new(self.observe::<Masked>()?),
            Rotation::TOPIC => Box::new(self.observe::<Rotation>()?),
            Motion::TOPIC => Box::new(self.observe::<Motion>()?),
            Refined::TOPIC => Box::new(self.observe::<Refined>()?),
            Pose::TOPIC => Box::new(self.observe::<Pose>()?),
            Loop::TOPIC => Box::new(self.observe::<Loop>()?),
            Correction::TOPIC => Box::new(self.observe::<Correction>()?),
            Fix::TOPIC => Box::new(self.observe::<Fix>()?),
            Objects::TOPIC => Box::new(self.observe::<Objects>()?),
            _ => return Ok(None),
        };
        Ok(Some(observer))
    }
}

impl<M: Message> TopicObserver for Observer<'_, M> {
    fn topic(&self) -> &'static str {
        M::TOPIC
    }

    fn take(&mut self) -> Result<Option<RecordedMessage>, StageError> {
        Ok(match self.next(Duration::ZERO)? {
            Next::Message(message, _) => Some(message.to_bytes()),
            Next::Idle | Next::Ended => None,
        })
    }

    fn has_ended(&self) -> bool {
        self.has_ended
    }

    fn listener(&self) -> &Listener {
        &self.data
    }

    fn expect(&mut self, next: u64, generation: u32) {
        self.sequence.expected = Some(next);
        self.sequence.generation = generation;
    }

    fn missed(&self) -> u64 {
        self.sequence.missed
    }

    fn skipped(&self, known: u32, item: &Item) -> Result<Option<GivenAnew>, StageError> {
        self.skipped_by(known, item)
    }
}
