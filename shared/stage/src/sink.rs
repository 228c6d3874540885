//! The loop of the last stage, which journals each pose before it publishes it.

use gyre_messages::{Header, Item, Message, MotionHeader, Pose, PoseHeader, StageId, flag};

use crate::{
    Launch, StageCounters, StageError, allocations, clock, reader::Reader, wake, writer::Writer,
};

/// The owner of the trajectory.
pub trait Sink {
    /// The stage that it is, or replaces.
    const HOP: StageId;

    /// Returns the last poses of the journal, at most `count`, oldest first, and whether the stream had ended.
    ///
    /// # Errors
    /// A journal that cannot be read.
    fn restore(&mut self, count: usize) -> Result<(Vec<PoseHeader>, bool), StageError>;
    /// Adds a motion, journals its pose and returns it.
    ///
    /// # Errors
    /// A journal that cannot be written.
    fn integrate(&mut self, motion: &MotionHeader) -> Result<PoseHeader, StageError>;
    /// Journals the end of the stream.
    ///
    /// # Errors
    /// A journal that cannot be written.
    fn end(&mut self, item: &Item) -> Result<(), StageError>;
}

/// Runs the sink on the motions of topic `M` until SIGTERM.
///
/// # Errors
/// A failure of the transport, a sequence gap, or an error of the sink.
pub fn run<M: Message<Header = MotionHeader>, S: Sink>(
    launch: &Launch,
    sink: &mut S,
) -> Result<StageCounters, StageError> {
    let poses = Writer::<Pose>::open(&launch.node, &launch.manifest)?;
    let (restored, ended) = sink.restore(Pose::sizes(&launch.manifest.window).history)?;
    republish::<S>(&poses, &restored)?;
    let next = restored
        .last()
        .map_or(0, |pose| pose.item.seq.saturating_add(1));
    let mut integration = Integration {
        sink,
        poses,
        ended,
        counters: StageCounters::default(),
    };
    if ended {
        integration.publish_end(restored.last().map(|pose| pose.item).unwrap_or_default())?;
    }
    let mut motions = Reader::<M>::open(launch, Some(next))?;
    integration.drain(&mut motions)?;
    loop {
        let woken = launch.signals.wait(
            &[motions.listener()],
            Some(integration.poses.listener()),
            wake::MAX_WAIT,
        )?;
        integration.counters.wakes += 1;
        if woken.stop {
            integration.counters.duplicates = motions.duplicates();
            return Ok(integration.counters);
        }
        if woken.may_have_new_readers() {
            integration.poses.accept_readers()?;
        }
        if integration.drain(&mut motions)? && woken.timed_out {
            integration.counters.wakes_caught_late += 1;
        }
    }
}

/// Publishes the last poses again. The source resumes at the newest one, and masking needs the motions of all of them.
fn republish<S: Sink>(poses: &Writer<Pose>, restored: &[PoseHeader]) -> Result<(), StageError> {
    let base = PoseHeader {
        item: Item {
            flags: flag::BASE | flag::SYNC,
            ..Item::default()
        },
        ..PoseHeader::default()
    };
    let Some((last, earlier)) = restored.split_last() else {
        return publish::<S>(poses, base);
    };
    for pose in earlier {
        publish::<S>(poses, *pose)?;
    }
    publish::<S>(poses, newest(*last))
}

/// Marks a pose as the newest. Older ones that are published again are not marked: a source that resumed at one of them would
/// send more scans than its readers have room for.
fn newest(pose: PoseHeader) -> PoseHeader {
    PoseHeader {
        item: Item {
            flags: pose.item.flags | flag::SYNC,
            ..pose.item
        },
        ..pose
    }
}

fn publish<S: Sink>(poses: &Writer<Pose>, pose: PoseHeader) -> Result<(), StageError> {
    let mut draft = poses.loan()?;
    *draft.header() = pose;
    poses.send(draft, S::HOP)
}

struct Integration<'a, S: Sink> {
    sink: &'a mut S,
    poses: Writer<Pose>,
    ended: bool,
    counters: StageCounters,
}

impl<S: Sink> Integration<'_, S> {
    fn drain<M: Message<Header = MotionHeader>>(
        &mut self,
        motions: &mut Reader<M>,
    ) -> Result<bool, StageError> {
        let mut progressed = false;
        while !self.ended {
            let Some(received) = motions.head()? else {
                break;
            };
            let mut motion = *received.header();
            match motion.item.is(flag::END) {
                true => {
                    self.sink.end(&motion.item)?;
                    self.publish_end(motion.item)?;
                    self.ended = true;
                }
                false => {
                    motion.item.hop_mut(S::HOP).received_ns = received.received_ns;
                    self.integrate(motion)?;
                }
            }
            motions.release();
            progressed = true;
        }
        Ok(progressed)
    }

    fn integrate(&mut self, mut motion: MotionHeader) -> Result<(), StageError> {
        let (started_ns, allocated) = (clock::now_ns(), allocations::so_far());
        motion.item.hop_mut(S::HOP).started_ns = started_ns;
        let pose = self.sink.integrate(&motion)?;
        self.counters.record(
            allocations::so_far() - allocated,
            clock::now_ns() - started_ns,
        );
        publish::<S>(&self.poses, newest(pose))
    }

    fn publish_end(&mut self, item: Item) -> Result<(), StageError> {
        let mut draft = self.poses.loan()?;
        *draft.header().item_mut() = Item {
            flags: flag::END,
            ..item
        };
        self.poses.send(draft, S::HOP)
    }
}
