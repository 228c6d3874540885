//! A descriptor to wait for several topics.

use std::{
    io,
    os::fd::{AsFd, BorrowedFd},
    time::Duration,
};

use gyre_client::RunError;
use gyre_ros2_messages::Ros2Message;
use ros2_client::{
    Subscription,
    dds::rustdds::mio1::{Events, Interest, Poll, Token, event::Source},
};

use crate::node::Node;

/// Events that are taken at once: one for each topic.
const CAPACITY: usize = 4;

pub struct Wakeups {
    poll: Poll,
    events: Events,
}

impl Wakeups {
    pub fn new() -> Result<Self, RunError> {
        Ok(Self {
            poll: Poll::new().map_err(failed)?,
            events: Events::with_capacity(CAPACITY),
        })
    }

    /// Subscribes to a topic as [`Node::subscribe`]; its messages make the descriptor readable.
    pub fn subscribe<M: Ros2Message + Send + 'static>(
        &mut self,
        node: &mut Node,
        topic: &str,
        depth: usize,
        is_lossy: bool,
    ) -> Result<Subscription<M>, RunError> {
        let mut topic: Subscription<M> = node.subscribe(topic, depth, is_lossy)?;
        self.add(&mut topic)?;
        Ok(topic)
    }

    /// Makes the descriptor readable when this topic or service has something to take.
    pub fn add(&mut self, source: &mut impl Source) -> Result<(), RunError> {
        // All are read after an event of one.
        let registry = self.poll.registry();
        let registered = registry.register(source, Token(0), Interest::READABLE);
        registered.map_err(failed)
    }

    pub fn descriptor(&self) -> BorrowedFd<'_> {
        self.poll.registry().as_fd()
    }

    /// Makes it unreadable until the next message. Take all messages after this, and not before.
    pub fn clear(&mut self) -> Result<(), RunError> {
        match self.poll.poll(&mut self.events, Some(Duration::ZERO)) {
            Err(error) if error.kind() != io::ErrorKind::Interrupted => Err(failed(error)),
            _ => Ok(()),
        }
    }
}

fn failed(error: io::Error) -> RunError {
    RunError::Input(format!("cannot wait for topics of ROS 2: {error}"))
}
