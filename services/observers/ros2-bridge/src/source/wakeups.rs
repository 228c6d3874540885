//! A descriptor to wait for several topics.

use std::{
    io,
    os::fd::{AsFd, BorrowedFd},
    time::Duration,
};

use gyre_stage::StageError;
use ros2_client::{
    Subscription,
    dds::rustdds::mio1::{Events, Interest, Poll, Token, event::Source},
};

/// Events that are taken at once: one for each topic.
const CAPACITY: usize = 4;

pub struct Wakeups {
    poll: Poll,
    events: Events,
}

impl Wakeups {
    pub fn new() -> Result<Self, StageError> {
        Ok(Self {
            poll: Poll::new().map_err(failed)?,
            events: Events::with_capacity(CAPACITY),
        })
    }

    pub fn add<M>(&mut self, topic: &mut Subscription<M>) -> Result<(), StageError>
    where
        Subscription<M>: Source,
    {
        // All topics are read after an event of one.
        let registered = self
            .poll
            .registry()
            .register(topic, Token(0), Interest::READABLE);
        registered.map_err(failed)
    }

    pub fn descriptor(&self) -> BorrowedFd<'_> {
        self.poll.registry().as_fd()
    }

    /// Makes it unreadable until the next message. Take all messages after this, and not before.
    pub fn clear(&mut self) -> Result<(), StageError> {
        match self.poll.poll(&mut self.events, Some(Duration::ZERO)) {
            Err(error) if error.kind() != io::ErrorKind::Interrupted => Err(failed(error)),
            _ => Ok(()),
        }
    }
}

fn failed(error: io::Error) -> StageError {
    StageError::Input(format!("cannot wait for topics of ROS 2: {error}"))
}
