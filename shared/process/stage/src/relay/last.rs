//! The stand-in for the last stages.

use std::os::fd::BorrowedFd;

use gyre_messages::{
    Item, Masked, Message, Motion, MotionHeader, Pose, PoseHeader, Refined, Rotation, Scan, StageId,
};

use crate::{
    Launch, StageCounters, StageError, counters, numbers::Numbers, outlet::RecordedMessage,
    reader::Reader, remote_progress, sink, transport::Listener, wake, writer::Writer,
};

/// Reads the topics of the last stages, which are on another machine, and publishes the poses that
/// come back from them.
pub struct LastStages<'a> {
    launch: &'a Launch,
    poses: Writer<Pose>,
    /// For masking, if the searches are on the other machine.
    motions: Option<Writer<Motion>>,
    inlets: Vec<Box<dyn Inlet>>,
    progress: Numbers<1>,
    counters: StageCounters,
}

impl<'a> LastStages<'a> {
    /// Opens the topics that it publishes. `publishes_motions`: motions come back too.
    pub fn open(launch: &'a Launch, publishes_motions: bool) -> Result<Self, StageError> {
        let (node, manifest) = (&launch.node, &launch.manifest);
        let motions = publishes_motions.then(|| Writer::open(node, manifest));
        Ok(Self {
            launch,
            progress: remote_progress::begin(manifest)?,
            motions: motions.transpose()?,
            poses: Writer::open(node, manifest)?,
            inlets: Vec::new(),
            counters: StageCounters::default(),
        })
    }

    /// Publishes the last poses again. The newest pose determines where the source continues;
    /// without any pose, the source begins.
    pub fn republish(&self, restored: &[PoseHeader]) -> Result<(), StageError> {
        sink::republish(&self.poses, restored, StageId::PoseIntegration)
    }

    pub fn history(&self) -> usize {
        Pose::sizes(&self.launch.manifest.window).history
    }

    pub fn read(&mut self, topics: &[&str]) -> Result<(), StageError> {
        let inlets = topics.iter().map(|topic| inlet(self.launch, topic));
        self.inlets = inlets.collect::<Result<_, _>>()?;
        Ok(())
    }

    /// Returns the next message of one of these topics, by its place among them; `None` if nothing
    /// has arrived yet.
    pub fn receive(&mut self, topic: usize) -> Result<Option<RecordedMessage>, StageError> {
        let inlet = self.inlets.get_mut(topic);
        inlet.map_or(Ok(None), |inlet| inlet.receive())
    }

    /// Reports the number of items whose poses the other machine owes, counted at the source.
    pub fn has_handed_over(&mut self, items: u64) -> Result<(), StageError> {
        self.progress.write([items])
    }

    /// Publishes a new pose, the credit for one more scan.
    pub fn publish_pose(&mut self, pose: PoseHeader) -> Result<(), StageError> {
        let item = &pose.item;
        let hop = item.hops[StageId::PoseIntegration as usize];
        counters::record(&mut self.counters, 0, hop.finished_ns - hop.started_ns);
        let hop = Some(StageId::PoseIntegration);
        self.poses.publish(sink::newest(pose), hop)
    }

    pub fn end(&self, item: Item) -> Result<(), StageError> {
        self.poses.end(item, Some(StageId::PoseIntegration))
    }

    pub fn publish_motion(&self, motion: MotionHeader) -> Result<(), StageError> {
        match &self.motions {
            Some(motions) => motions.publish(motion, None),
            None => Ok(()),
        }
    }

    /// Sleeps until a topic has a message or the connection has something to read, and answers the
    /// handshakes of new readers; true on a request to stop.
    pub fn sleep(&mut self, connection: BorrowedFd<'_>) -> Result<bool, StageError> {
        let data: Vec<_> = self.inlets.iter().map(|inlet| inlet.listener()).collect();
        let motions = self.motions.as_ref().map(|motions| motions.listener());
        let handshakes: Vec<_> = [self.poses.listener()].into_iter().chain(motions).collect();
        let signals = &self.launch.signals;
        let woken =
            signals.wait_or_readable(&data, &handshakes, Some(connection), wake::MAX_WAIT)?;
        self.counters.wakes += 1;
        if woken.may_have_new_readers() {
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

trait Inlet {
    fn receive(&mut self) -> Result<Option<RecordedMessage>, StageError>;
    fn listener(&self) -> &Listener;
}

fn inlet(launch: &Launch, topic: &str) -> Result<Box<dyn Inlet>, StageError> {
    // Whichever item comes first: after a restart that is one of the history.
    Ok(match topic {
        Scan::TOPIC => Box::new(Reader::<Scan>::open(launch, None)?),
        Masked::TOPIC => Box::new(Reader::<Masked>::open(launch, None)?),
        Rotation::TOPIC => Box::new(Reader::<Rotation>::open(launch, None)?),
        Motion::TOPIC => Box::new(Reader::<Motion>::open(launch, None)?),
        Refined::TOPIC => Box::new(Reader::<Refined>::open(launch, None)?),
        _ => {
            let reason = format!("no stage of the stream reads the topic `{topic}`");
            return Err(StageError::Configuration(reason));
        }
    })
}

impl<M: Message> Inlet for Reader<M> {
    fn receive(&mut self) -> Result<Option<RecordedMessage>, StageError> {
        self.take_bytes()
    }

    fn listener(&self) -> &Listener {
        Self::listener(self)
    }
}
