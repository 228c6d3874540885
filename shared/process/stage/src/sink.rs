//! The loop of the last stage, which journals each pose before it publishes it.

use std::fs;

use gyre_contract::{
    Item, Masked, Message, Motion, MotionHeader, Pose, PoseHeader, StageId, flag,
    run::StageCounters,
};
use gyre_transport::{
    Manifest, RunError,
    reader::{Port, Reader, Received},
    run,
    transport::Listener,
    wake,
    writer::Writer,
};

use crate::{Launch, counters::Work};

const NOTICE: &str = "notice";
const POSES_LOST: &str = "poses-lost";

/// The owner of the trajectory.
pub trait Sink {
    /// The stage that it is, or replaces.
    const HOP: StageId;

    /// Returns whether it takes the scan of each motion as well.
    fn takes_scans(&self) -> bool {
        false
    }
    /// Returns the last poses of the journal, at most `count`, oldest first, and whether the stream
    /// had ended.
    fn restore(&mut self, count: usize) -> Result<(Vec<PoseHeader>, bool), RunError>;
    /// Adds a motion, with its scan if the sink takes scans, journals its pose and returns it.
    fn integrate(
        &mut self,
        motion: &MotionHeader,
        scan: Option<&Received<Masked>>,
    ) -> Result<PoseHeader, RunError>;
    fn end(&mut self, item: &Item) -> Result<(), RunError>;
}

/// Runs the sink on the motions of the run until SIGTERM.
pub fn run<S: Sink>(launch: &Launch, sink: &mut S) -> Result<StageCounters, RunError> {
    launch.take_place()?;
    let poses = Writer::<Pose>::open(&launch.node, &launch.manifest)?;
    let (restored, ended) = sink.restore(Pose::sizes(&launch.manifest.window).history)?;
    republish(&poses, &restored, S::HOP)?;
    let last = restored.last().map(|pose| pose.item);
    let next = last.map_or(0, |last| last.seq.saturating_add(1));
    // Both have the same header.
    let topic = gyre_contract::composed(launch.manifest.refines);
    if ended {
        poses.end(last.unwrap_or_default(), Some(S::HOP))?;
    }
    let motions = Port::to(topic, &launch.node, &launch.manifest)?;
    let scans = sink.takes_scans().then(|| launch.reader(Some(next)));
    let mut integration = Integration {
        sink,
        poses,
        motions: Reader::of(motions, Some(next)),
        scans: scans.transpose()?,
        ended,
        counters: StageCounters::default(),
    };
    integration.drain()?;
    loop {
        let woken = launch.signals.wait(
            &[integration.listener()],
            Some(integration.poses.listener()),
            wake::MAX_WAIT,
        )?;
        integration.counters.wakes += 1;
        if woken.stop {
            let of_scans = integration.scans.as_ref().map_or(0, |it| it.duplicates);
            integration.counters.duplicates = integration.motions.duplicates + of_scans;
            return Ok(integration.counters);
        }
        if woken.may_have_new_readers {
            integration.poses.accept_readers()?;
        }
        if integration.drain()? && woken.timed_out {
            integration.counters.wakes_caught_late += 1;
        }
    }
}

pub fn notice(manifest: &Manifest) -> Option<String> {
    let notice = fs::read_to_string(manifest.root.join(NOTICE)).ok()?;
    (!notice.is_empty()).then_some(notice)
}

pub fn set_notice(manifest: &Manifest, notice: &str) -> Result<(), RunError> {
    run::write(manifest.root.join(NOTICE), notice)
}

/// Returns the error that poses are lost: the run is to begin again behind those in the journal.
pub fn poses_lost(manifest: &Manifest, sentence: String) -> RunError {
    match run::write(manifest.root.join(POSES_LOST), &sentence) {
        Ok(()) => RunError::Input(sentence),
        Err(error) => error,
    }
}

/// Returns whether a run has ended with [`poses_lost`].
pub fn has_lost_poses(manifest: &Manifest) -> bool {
    manifest.root.join(POSES_LOST).exists()
}

/// Publishes the last poses again. The source resumes at the newest one, and masking needs the
/// motions of all of them.
pub(crate) fn republish(
    poses: &Writer<Pose>,
    restored: &[PoseHeader],
    hop: StageId,
) -> Result<(), RunError> {
    let Some((last, earlier)) = restored.split_last() else {
        let mut base = PoseHeader::default();
        base.item.flags = flag::BASE | flag::SYNC;
        return poses.publish(base, Some(hop));
    };
    for pose in earlier {
        poses.publish(*pose, Some(hop))?;
    }
    poses.publish(newest(*last), Some(hop))
}

/// Marks a pose as the newest. Older ones that are published again are not marked: a source that
/// resumed at one of them would send more scans than its readers have room for.
pub(crate) fn newest(mut pose: PoseHeader) -> PoseHeader {
    pose.item.flags |= flag::SYNC;
    pose
}

struct Integration<'a, S: Sink> {
    sink: &'a mut S,
    poses: Writer<Pose>,
    motions: Reader<Motion>,
    /// The scans of the motions, if the sink takes them.
    scans: Option<Reader<Masked>>,
    ended: bool,
    counters: StageCounters,
}

impl<S: Sink> Integration<'_, S> {
    /// Integrates all motions in the queue; returns whether there were any.
    fn drain(&mut self) -> Result<bool, RunError> {
        let mut progressed = false;
        while !self.ended {
            let Some(head) = self.motions.head()? else {
                break;
            };
            let (mut motion, mut received_ns) = (*head.header(), head.received_ns);
            let mut scan = None;
            if let Some(scans) = &mut self.scans {
                let Some(head) = scans.head()? else {
                    break;
                };
                let (expected, got) = (motion.item.seq, head.item().seq);
                if got != expected {
                    return Err(RunError::gap(Masked::TOPIC, expected, got));
                }
                received_ns = received_ns.max(head.received_ns);
                scan = Some(head);
            }
            if motion.item.is(flag::END) {
                self.sink.end(&motion.item)?;
                self.poses.end(motion.item, Some(S::HOP))?;
                self.ended = true;
            } else {
                let work = Work::begin();
                let hop = motion.item.hop_mut(S::HOP);
                (hop.received_ns, hop.started_ns) = (received_ns, work.started_ns);
                let pose = self.sink.integrate(&motion, scan)?;
                work.end(&mut self.counters);
                self.poses.publish(newest(pose), Some(S::HOP))?;
            }
            self.motions.release();
            self.scans.iter_mut().for_each(Reader::release);
            progressed = true;
        }
        Ok(progressed)
    }

    /// Returns the listener of the input that is missing, as
    /// [`Inputs::listeners`](crate::inputs::Inputs::listeners).
    fn listener(&self) -> &Listener {
        match (&self.scans, self.motions.current()) {
            (Some(scans), Some(_)) => scans.listener(),
            _ => self.motions.listener(),
        }
    }
}
