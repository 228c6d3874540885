//! Stand-ins for the stages of a run that work on another machine: they have the places of these
//! stages, so they miss nothing. How messages get to the other machine is not known here.

use std::os::fd::BorrowedFd;

use gyre_contract::{
    Item, Message, Motion, MotionHeader, Pose, PoseHeader, Scan, StageId, run::StageCounters,
};
use gyre_transport::{
    AnyMessage, RecordedMessage, RunError, clock,
    numbers::Numbers,
    reader::{Port, Reader},
    wake,
    writer::{TopicWriter, Writer, item_of},
};

use crate::{
    Launch, counters, schedule, sink,
    source::{Feed, hop},
};

/// Publishes messages of the first stages, which are on another machine, in the place of the
/// source. It is never late: the other machine may be out of reach.
pub struct FirstStages<'a> {
    feed: Feed<'a, AnyMessage>,
    /// The motions that go back to the first stages beside the poses.
    motions: Option<Reader<Motion>>,
    /// The supervisor takes its publisher for a sign that the source has started.
    _scans: Option<Writer<Scan>>,
}

impl<'a> FirstStages<'a> {
    /// Opens the topics. `reads_motions`: the motions of this run are needed on the other machine.
    pub fn open(
        launch: &'a Launch,
        topics: &[&str],
        reads_motions: bool,
    ) -> Result<Self, RunError> {
        let motions = reads_motions.then(|| launch.reader(None));
        let publishes_scans = topics.contains(&Scan::TOPIC);
        let scans = || Writer::open(&launch.node, &launch.manifest);
        Ok(Self {
            motions: motions.transpose()?,
            feed: Feed::open(launch, || {
                TopicWriter::of_stream(&launch.node, &launch.manifest, topics)
            })?
            .never_late(),
            _scans: (!publishes_scans).then(scans).transpose()?,
        })
    }

    /// Reads the new poses. Call it after each sleep.
    pub fn update(&mut self) -> Result<(), RunError> {
        self.feed.credit.update()
    }

    /// Returns the newest pose of the trajectory at the last start of the last stage; `None` before
    /// its report.
    pub fn resume_at(&self) -> Option<&Item> {
        self.feed.credit.resume_at.as_ref()
    }

    pub fn has_ended(&self) -> bool {
        self.feed.credit.has_ended
    }

    pub fn newest_pose(&self) -> Option<u64> {
        self.feed.credit.newest
    }

    pub fn next_motion(&mut self) -> Result<Option<RecordedMessage>, RunError> {
        self.motions.as_mut().map_or(Ok(None), Reader::take_bytes)
    }

    pub fn admits(&self, seq: u64) -> bool {
        let window = &self.feed.launch.manifest.window;
        window.admits(seq, self.newest_pose())
    }

    /// Publishes the messages about item `seq`, one for each topic in the order of
    /// [`open`](Self::open), but for those that have none. Its times on the other machine are on
    /// another clock: here the item begins with its arrival.
    pub fn publish(
        &mut self,
        messages: &[Option<RecordedMessage>],
        seq: u64,
    ) -> Result<(), RunError> {
        let now_ns = clock::now_ns();
        let mut item = Item {
            due_ns: now_ns,
            ..item_of(messages.iter().flatten(), seq)?
        };
        *item.hop_mut(StageId::RadarReplay) = hop(now_ns, now_ns);
        for (output, message) in self.feed.outputs.iter().zip(messages) {
            if let Some(message) = message {
                output.republish(message, item)?;
            }
        }
        counters::record(&mut self.feed.counters, 0, clock::now_ns() - now_ns);
        self.feed.schedule.has_published(item.published)
    }

    pub fn end(&mut self, item: Item) -> Result<(), RunError> {
        self.feed.end(item)
    }

    /// Sleeps until there is a pose or a motion, or the connection has something to read, and
    /// answers the handshakes of new readers; true on a request to stop.
    pub fn sleep(&mut self, connection: BorrowedFd<'_>) -> Result<bool, RunError> {
        let motions = self.motions.as_ref().map(Reader::listener);
        let slept = self
            .feed
            .sleep_until(motions, Some(connection), wake::MAX_WAIT);
        match slept {
            Err(RunError::Stopped) => Ok(true),
            slept => slept.map(|()| false),
        }
    }

    pub fn counters(&self) -> StageCounters {
        self.feed.counters.clone()
    }
}

/// Reads the topics of the last stages, which are on another machine, and publishes the poses that
/// come back from them.
pub struct LastStages<'a> {
    launch: &'a Launch,
    poses: Writer<Pose>,
    /// For masking, if the searches are on the other machine.
    motions: Option<Writer<Motion>>,
    inlets: Vec<Reader<AnyMessage>>,
    progress: Numbers<1>,
    counters: StageCounters,
}

impl<'a> LastStages<'a> {
    /// Opens the topics that it publishes. `publishes_motions`: motions come back too.
    pub fn open(launch: &'a Launch, publishes_motions: bool) -> Result<Self, RunError> {
        let (node, manifest) = (&launch.node, &launch.manifest);
        let motions = publishes_motions.then(|| Writer::open(node, manifest));
        Ok(Self {
            launch,
            progress: schedule::begin_elsewhere(manifest)?,
            motions: motions.transpose()?,
            poses: Writer::open(node, manifest)?,
            inlets: Vec::new(),
            counters: StageCounters::default(),
        })
    }

    /// Publishes the last poses again. The newest pose determines where the source continues;
    /// without any pose, the source begins.
    pub fn republish(&self, restored: &[PoseHeader]) -> Result<(), RunError> {
        sink::republish(&self.poses, restored, StageId::PoseIntegration)
    }

    pub fn history(&self) -> usize {
        Pose::sizes(&self.launch.manifest.window).history
    }

    pub fn read(&mut self, topics: &[&str]) -> Result<(), RunError> {
        let inlets = topics.iter().map(|topic| inlet(self.launch, topic));
        self.inlets = inlets.collect::<Result<_, _>>()?;
        Ok(())
    }

    /// Returns the next message of one of these topics, by its place among them; `None` if nothing
    /// has arrived yet.
    pub fn receive(&mut self, topic: usize) -> Result<Option<RecordedMessage>, RunError> {
        let inlet = self.inlets.get_mut(topic);
        inlet.map_or(Ok(None), Reader::take_bytes)
    }

    /// Reports the number of items whose poses the other machine owes, counted at the source.
    pub fn has_handed_over(&mut self, items: u64) -> Result<(), RunError> {
        self.progress.write([items])
    }

    pub fn publish_pose(&mut self, pose: PoseHeader) -> Result<(), RunError> {
        let item = &pose.item;
        let hop = item.hops[StageId::PoseIntegration as usize];
        counters::record(&mut self.counters, 0, hop.finished_ns - hop.started_ns);
        let hop = Some(StageId::PoseIntegration);
        self.poses.publish(sink::newest(pose), hop)
    }

    pub fn end(&self, item: Item) -> Result<(), RunError> {
        self.poses.end(item, Some(StageId::PoseIntegration))
    }

    pub fn publish_motion(&self, motion: MotionHeader) -> Result<(), RunError> {
        match &self.motions {
            Some(motions) => motions.publish(motion, None),
            None => Ok(()),
        }
    }

    /// Sleeps until a topic has a message or the connection has something to read, and answers the
    /// handshakes of new readers; true on a request to stop.
    pub fn sleep(&mut self, connection: BorrowedFd<'_>) -> Result<bool, RunError> {
        let data: Vec<_> = self.inlets.iter().map(Reader::listener).collect();
        let motions = self.motions.as_ref().map(|motions| motions.listener());
        let handshakes: Vec<_> = [self.poses.listener()].into_iter().chain(motions).collect();
        let signals = &self.launch.signals;
        let woken =
            signals.wait_or_readable(&data, &handshakes, Some(connection), wake::MAX_WAIT)?;
        self.counters.wakes += 1;
        if woken.may_have_new_readers {
            self.poses.accept_readers()?;
            let motions = self.motions.as_ref();
            motions.map_or(Ok(()), |motions| motions.accept_readers())?;
        }
        Ok(woken.stop)
    }

    pub fn counters(&self) -> StageCounters {
        self.counters.clone()
    }
}

fn inlet(launch: &Launch, name: &str) -> Result<Reader<AnyMessage>, RunError> {
    let topic = gyre_contract::topic(name)
        .ok_or_else(|| RunError::Input(format!("no stage publishes the topic `{name}`")))?;
    // Whichever item comes first: after a restart that is one of the history.
    let port = Port::to(topic, &launch.node, &launch.manifest)?;
    Ok(Reader::of(port, None))
}
