//! The process of a program in a run of its own, and this process in place of the rest of the run.

use std::{collections::BTreeMap, time::Duration};

use gyre_messages::{Item, Pose, PoseHeader, StageId, flag};
use gyre_stage::{Listener, Manifest, StageError};
use gyre_supervise::{
    Death, Scheduling, SuperviseError,
    rig::{Feed, Process, Recorded, Rig, Tap},
};

use crate::StageTopics;

/// A program in a run of its own, which this process feeds and receives from.
pub struct Harness<'a> {
    // Dropped in this order: process, ports, run.
    process: Option<Process>,
    feeds: BTreeMap<&'static str, Box<dyn Feed>>,
    output: Box<dyn Tap>,
    rig: Rig<'a>,
    stage: StageId,
    topics: StageTopics,
}

/// A message that a program has sent.
pub enum Sent {
    /// A message that keeps the rules of its fields.
    Message(Recorded),
    /// One that every reader refuses.
    Malformed {
        /// The sequence number.
        seq: u64,
        /// The rule that it breaks, in a sentence.
        sentence: String,
    },
}

impl<'a> Harness<'a> {
    /// Opens the topics of a stage. No process is started.
    ///
    /// # Errors
    /// A failure of the transport.
    pub fn open(rig: Rig<'a>, stage: StageId) -> Result<Self, StageError> {
        let topics = StageTopics::of(stage, rig.manifest());
        let mut harness = Self {
            process: None,
            feeds: BTreeMap::new(),
            output: rig.tap(topics.output)?,
            rig,
            stage,
            topics,
        };
        harness.open_feeds()?;
        Ok(harness)
    }

    /// Opens the publishers of the inputs, with empty histories.
    ///
    /// # Errors
    /// A failure of the transport.
    pub fn open_feeds(&mut self) -> Result<(), StageError> {
        self.feeds.clear();
        for (topic, _) in &self.topics.inputs {
            self.feeds.insert(topic, self.rig.feed(topic)?);
        }
        Ok(())
    }

    /// Starts the process.
    ///
    /// # Errors
    /// The command cannot be started.
    pub fn start(
        &mut self,
        command: &[String],
        scheduling: &Scheduling,
    ) -> Result<(), SuperviseError> {
        self.process = Some(self.rig.start(self.stage.name(), command, scheduling)?);
        Ok(())
    }

    /// Returns the run.
    pub fn rig(&self) -> &Rig<'a> {
        &self.rig
    }

    /// Returns the manifest of the run.
    pub fn manifest(&self) -> &Manifest {
        self.rig.manifest()
    }

    /// Returns the topics of the stage.
    pub fn topics(&self) -> &StageTopics {
        &self.topics
    }

    /// Returns the publishers of the inputs by topic.
    pub fn feeds(&self) -> &BTreeMap<&'static str, Box<dyn Feed>> {
        &self.feeds
    }

    /// Returns the listener that the process notifies of its output.
    pub fn listener(&self) -> &Listener {
        self.output.listener()
    }

    /// Answers the subscribe handshakes of the process; returns the topics that it has notified.
    ///
    /// # Errors
    /// A failure of the transport.
    pub fn answer_handshakes(&self) -> Result<Vec<&'static str>, StageError> {
        let mut notified = Vec::new();
        for (topic, feed) in &self.feeds {
            if feed.answer_handshakes()? {
                notified.push(*topic);
            }
        }
        Ok(notified)
    }

    /// Connects to all subscribers, whether they have notified or not.
    ///
    /// # Errors
    /// A failure of the transport.
    pub fn connect(&self) -> Result<(), StageError> {
        self.feeds.values().try_for_each(|feed| feed.connect())
    }

    /// Returns whether the process has opened the topic that it publishes.
    pub fn has_publisher(&self) -> bool {
        self.rig.has_publisher(self.stage)
    }

    /// Publishes a message on a topic, if it is one of the inputs.
    ///
    /// # Errors
    /// A failure of the transport.
    pub fn feed(&self, topic: &str, message: &Recorded) -> Result<(), StageError> {
        let feed = self.feeds.get(topic);
        feed.map_or(Ok(()), |feed| feed.send(message))
    }

    /// Receives the next message of the process; `None` if there is none yet.
    ///
    /// # Errors
    /// A failure of the transport.
    pub fn receive(&self) -> Result<Option<Sent>, StageError> {
        match self.output.receive() {
            Ok(message) => Ok(message.map(Sent::Message)),
            Err(StageError::Malformed { seq, reason, .. }) => Ok(Some(Sent::Malformed {
                seq,
                sentence: format!("item {seq} cannot be read by any stage: {reason}"),
            })),
            Err(error) => Err(error),
        }
    }

    /// Sleeps until the process has sent something or `limit` has passed; true on a request to
    /// stop.
    ///
    /// # Errors
    /// The system refuses to wait.
    pub fn sleep(&self, limit: Duration) -> Result<bool, StageError> {
        self.rig.sleep(&[self.output.as_ref()], limit)
    }

    /// Returns how the process ended; `None` while it runs or before it is started.
    pub fn death(&mut self) -> Option<Death> {
        self.process.as_mut().and_then(Process::death)
    }

    /// Returns whether the process is there and has not ended.
    pub fn is_running(&mut self) -> bool {
        self.process.as_mut().is_some_and(|it| it.death().is_none())
    }

    /// Sends SIGTERM.
    pub fn terminate(&self) {
        self.process.iter().for_each(Process::terminate);
    }

    /// Kills the process with its group, and waits for its end.
    ///
    /// # Errors
    /// It does not end.
    pub fn kill(&mut self) -> Result<(), SuperviseError> {
        self.process.take().map_or(Ok(()), Process::kill)
    }
}

/// Returns the message with which a sink without poses starts.
pub fn start_of_trajectory() -> Recorded {
    let start = PoseHeader {
        item: Item {
            flags: flag::BASE | flag::SYNC,
            ..Item::default()
        },
        ..PoseHeader::default()
    };
    Recorded::of::<Pose>(&start, &[], 0)
}
