//! A program alone in the place of a stage: its process in a run of its own, and this process in
//! place of the rest of the run.

use std::{collections::BTreeMap, path::PathBuf};

use gyre_client::{Manifest, RunError, Signals, TopicWriter};
use gyre_configuration::terminal::own;
use gyre_contract::{Item, Pose, PoseHeader, StageId, StageTopics, flag};
use gyre_supervise::{
    Death, Scheduling, SuperviseError,
    rig::{Process, Recorded, Rig, Tap},
};

#[derive(Clone, Debug)]
pub struct Candidate {
    pub stage: StageId,
    pub command: Vec<String>,
    pub scheduling: Scheduling,
    /// The manifest of the run, without prefix and root.
    pub manifest: Manifest,
    pub configuration: String,
}

impl Candidate {
    pub(crate) fn topics(&self) -> StageTopics {
        StageTopics::of(self.stage, &self.manifest.window, self.manifest.refines)
    }

    /// Creates a run that writes to `out`, without its services.
    pub(crate) fn rig<'a>(
        &self,
        out: PathBuf,
        signals: &'a Signals,
    ) -> Result<Rig<'a>, SuperviseError> {
        for folder in ["log", "journal"] {
            gyre_storage::create_folder(&out.join(folder)).map_err(RunError::from)?;
        }
        let manifest = Manifest {
            out,
            ..self.manifest.clone()
        };
        let guardian = [own().display().to_string(), "guard".to_owned()];
        Rig::new(manifest, &self.configuration, &guardian, signals)
    }
}

/// A program in a run of its own, which this process feeds and receives from.
pub(crate) struct Harness<'a> {
    // Dropped in this order: process, ports, run.
    pub process: Option<Process>,
    /// The publishers of the inputs by topic.
    feeds: BTreeMap<&'static str, TopicWriter>,
    pub output: Tap,
    pub rig: Rig<'a>,
    candidate: &'a Candidate,
    pub topics: StageTopics,
}

pub(crate) enum Sent {
    /// A message that keeps the rules of its fields.
    Message(Recorded),
    /// A message that every reader refuses, and a sentence about the rule that it breaks.
    Malformed { seq: u64, sentence: String },
}

impl<'a> Harness<'a> {
    /// Creates the services of the run, and opens the topics of the stage.
    pub(crate) fn open(mut rig: Rig<'a>, candidate: &'a Candidate) -> Result<Self, RunError> {
        rig.create_services()?;
        let topics = candidate.topics();
        let mut harness = Self {
            process: None,
            feeds: BTreeMap::new(),
            output: rig.tap(topics.output)?,
            rig,
            candidate,
            topics,
        };
        harness.open_feeds()?;
        Ok(harness)
    }

    /// Opens the publishers of the inputs, with empty histories.
    pub(crate) fn open_feeds(&mut self) -> Result<(), RunError> {
        self.feeds.clear();
        for topic in self.topics.inputs() {
            self.feeds.insert(topic, self.rig.feed(topic)?);
        }
        Ok(())
    }

    pub(crate) fn start(&mut self, stands_by: bool) -> Result<(), SuperviseError> {
        let (candidate, name) = (self.candidate, self.candidate.stage.name());
        let (command, scheduling) = (&candidate.command, &candidate.scheduling);
        self.process = Some(self.rig.start(name, command, scheduling, stands_by)?);
        Ok(())
    }

    /// Answers the subscribe handshakes of the process; returns the topics that it has notified.
    pub(crate) fn answer_handshakes(&self) -> Result<Vec<&'static str>, RunError> {
        let mut notified = Vec::new();
        for (topic, feed) in &self.feeds {
            if feed.answer_handshakes()? {
                notified.push(*topic);
            }
        }
        Ok(notified)
    }

    /// Connects to all subscribers, whether they have notified or not.
    pub(crate) fn connect(&self) -> Result<(), RunError> {
        self.feeds
            .values()
            .try_for_each(TopicWriter::accept_readers)
    }

    pub(crate) fn has_publisher(&self) -> bool {
        self.rig.has_publisher(self.candidate.stage)
    }

    pub(crate) fn feed(&self, topic: &str, message: &Recorded) -> Result<(), RunError> {
        let feed = self.feeds.get(topic);
        feed.map_or(Ok(()), |feed| message.send(feed))
    }

    /// Receives the next message of the process; `None` if there is no message yet.
    pub(crate) fn receive(&self) -> Result<Option<Sent>, RunError> {
        match Recorded::receive(&self.output) {
            Ok(message) => Ok(message.map(Sent::Message)),
            Err(RunError::Malformed { seq, reason, .. }) => Ok(Some(Sent::Malformed {
                seq,
                sentence: format!("item {seq} cannot be read by any stage: {reason}"),
            })),
            Err(error) => Err(error),
        }
    }

    /// Returns the end of the process; `None` while it runs or before it is started.
    pub(crate) fn death(&mut self) -> Option<Death> {
        self.process.as_mut().and_then(Process::death)
    }
}

/// Returns the first message of a sink without poses.
pub(crate) fn start_of_trajectory() -> Recorded {
    let start = PoseHeader {
        item: Item {
            flags: flag::BASE | flag::SYNC,
            ..Item::default()
        },
        ..PoseHeader::default()
    };
    Recorded::of::<Pose>(&start, &[], 0)
}
