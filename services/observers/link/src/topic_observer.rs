//! Observers of a run's topics that return the messages as bytes.

use std::time::Duration;

use gyre_messages::{
    Correction, Fix, Loop, Masked, Message, Motion, Pose, Refined, Rotation, Scan,
};
use gyre_stage::{
    Listener, StageError,
    observer::{Next, ObservedRun, Observer},
    source::RecordedMessage,
};

/// The observer of a topic, whatever its type.
pub(crate) trait TopicObserver {
    /// Takes the next message that is there.
    fn take(&mut self) -> Result<Option<RecordedMessage>, StageError>;
    /// Returns the listener that the publisher notifies.
    fn listener(&self) -> &Listener;
    /// Returns whether the stream has ended.
    fn has_ended(&self) -> bool;
}

struct Typed<'run, M: Message> {
    observer: Observer<'run, M>,
    has_ended: bool,
}

/// Observes a topic; `None` if there is no such topic.
pub(crate) fn observe<'run>(
    run: &'run ObservedRun,
    topic: &str,
) -> Option<Result<Box<dyn TopicObserver + 'run>, StageError>> {
    Some(match topic {
        Scan::TOPIC => Typed::<Scan>::on(run),
        Masked::TOPIC => Typed::<Masked>::on(run),
        Rotation::TOPIC => Typed::<Rotation>::on(run),
        Motion::TOPIC => Typed::<Motion>::on(run),
        Refined::TOPIC => Typed::<Refined>::on(run),
        Pose::TOPIC => Typed::<Pose>::on(run),
        Loop::TOPIC => Typed::<Loop>::on(run),
        Correction::TOPIC => Typed::<Correction>::on(run),
        Fix::TOPIC => Typed::<Fix>::on(run),
        _ => return None,
    })
}

impl<'run, M: Message> Typed<'run, M> {
    fn on(run: &'run ObservedRun) -> Result<Box<dyn TopicObserver + 'run>, StageError> {
        Ok(Box::new(Self {
            observer: run.observe::<M>()?,
            has_ended: false,
        }))
    }
}

impl<M: Message> TopicObserver for Typed<'_, M> {
    fn take(&mut self) -> Result<Option<RecordedMessage>, StageError> {
        while !self.has_ended {
            match self.observer.next(Duration::ZERO) {
                Ok(Next::Message(message, _)) => return Ok(Some(message.to_bytes())),
                Ok(Next::Idle) => break,
                Ok(Next::Ended) => self.has_ended = true,
                // The run judges what its stages send. The message counts as missed.
                Err(StageError::Malformed { .. }) => {}
                Err(error) => return Err(error),
            }
        }
        Ok(None)
    }

    fn listener(&self) -> &Listener {
        self.observer.listener()
    }

    fn has_ended(&self) -> bool {
        self.has_ended
    }
}
