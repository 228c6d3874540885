//! The observers of the topics, whose messages become values.

use std::time::Duration;

use gyre_messages::{Masked, Message, Motion, Pose, Refined, Rotation, Scan};
use gyre_stage::{
    Listener, StageError,
    observer::{Next, ObservedRun, Observer},
    reader::Received,
};
use gyre_supervise::rig::Recorded;

/// The observer of a topic, whatever its type.
pub(crate) trait Inlet {
    /// Takes the next message that is there.
    ///
    /// # Errors
    /// A failure of the transport.
    fn take(&mut self) -> Result<Option<Recorded>, StageError>;
    /// Returns the listener that the publisher notifies.
    fn listener(&self) -> &Listener;
    /// Returns whether the stream has ended.
    fn has_ended(&self) -> bool;
}

struct TypedInlet<'run, M: Message> {
    observer: Observer<'run, M>,
    has_ended: bool,
}

/// Observes a topic of a stage.
///
/// # Errors
/// No place is free, the run has ended, or the transport fails.
pub(crate) fn inlet<'run>(
    run: &'run ObservedRun,
    topic: &str,
) -> Result<Box<dyn Inlet + 'run>, StageError> {
    match topic {
        Scan::TOPIC => TypedInlet::<Scan>::on(run),
        Masked::TOPIC => TypedInlet::<Masked>::on(run),
        Rotation::TOPIC => TypedInlet::<Rotation>::on(run),
        Motion::TOPIC => TypedInlet::<Motion>::on(run),
        Refined::TOPIC => TypedInlet::<Refined>::on(run),
        _ => TypedInlet::<Pose>::on(run),
    }
}

impl<'run, M: Message<Header: Copy>> TypedInlet<'run, M> {
    fn on(run: &'run ObservedRun) -> Result<Box<dyn Inlet + 'run>, StageError> {
        Ok(Box::new(Self {
            observer: run.observe::<M>()?,
            has_ended: false,
        }))
    }
}

impl<M: Message<Header: Copy>> Inlet for TypedInlet<'_, M> {
    fn take(&mut self) -> Result<Option<Recorded>, StageError> {
        loop {
            match self.observer.next(Duration::ZERO) {
                Ok(Next::Message(message, _)) => return Ok(Some(recorded(message))),
                Ok(Next::Idle) => return Ok(None),
                Ok(Next::Ended) => {
                    self.has_ended = true;
                    return Ok(None);
                }
                // The run judges what its stages send. The item counts as missed.
                Err(StageError::Malformed { .. }) => {}
                Err(error) => return Err(error),
            }
        }
    }

    fn listener(&self) -> &Listener {
        self.observer.listener()
    }

    fn has_ended(&self) -> bool {
        self.has_ended
    }
}

/// Copies what the header describes.
fn recorded<M: Message<Header: Copy>>(message: &Received<M>) -> Recorded {
    let bytes = message.values::<u8>();
    let content = M::content_bytes(message.header()).unwrap_or(bytes.len());
    let content = &bytes[..content.min(bytes.len())];
    Recorded::of::<M>(message.header(), content, message.received_ns)
}
