//! The loop of the last stage, which journals each pose before it publishes it.

use std::fs;

use gyre_messages::{
    Item, Masked, Message, Motion, MotionHeader, Pose, PoseHeader, Refined, StageId, flag,
};

use crate::{
    Launch, Manifest, StageCounters, StageError,
    counters::Work,
    reader::{Port, Reader, Received},
    run,
    transport::Listener,
    wake,
    writer::Writer,
};

const NOTICE: &str = "notice";

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
    fn restore(&mut self, count: usize) -> Result<(Vec<PoseHeader>, bool), StageError>;
    /// Adds a motion, with its scan if the sink takes scans, journals its pose and returns it.
    fn integrate(
        &mut self,
        motion: &MotionHeader,
        scan: Option<&Received<Masked>>,
    ) -> Result<PoseHeader, StageError>;
    fn end(&mut self, item: &Item) -> Result<(), StageError>;
}

/// Runs the sink on the motions of the run until SIGTERM.
pub fn run<S: Sink>(launch: &Launch, sink: &mut S) -> Result<StageCounters, StageError> {
    launch.take_place()?;
    let poses = Writer::<Pose>::open(&launch.node, &launch.manifest)?;
    let (restored, ended) = sink.restore(Pose::sizes(&launch.manifest.window).history)?;
    republish(&poses, &restored, S::HOP)?;
    let last = restored.last().map(|pose| pose.item);
    let next = last.map_or(0, |last| last.seq.saturating_add(1));
    let mut integration = Integration {
        sink,
        poses,
        ended,
        counters: StageCounters::default(),
    };
    if ended {
        let last = last.unwrap_or_default();
        integration.poses.end(last, Some(S::HOP))?;
    }
    let mut inputs = Motions::open(launch, next, integration.sink.takes_scans())?;
    integration.drain(&mut inputs)?;
    loop {
        let woken = launch.signals.wait(
            &[inputs.listener()],
            Some(integration.poses.listener()),
            wake::MAX_WAIT,
        )?;
        integration.counters.wakes += 1;
        if woken.stop {
            integration.counters.duplicates = inputs.duplicates();
            return Ok(integration.counters);
        }
        if woken.may_have_new_readers() {
            integration.poses.accept_readers()?;
        }
        if integration.drain(&mut inputs)? && woken.timed_out {
            integration.counters.wakes_caught_late += 1;
        }
    }
}

pub fn notice(manifest: &Manifest) -> Option<String> {
    let notice = fs::read_to_string(manifest.root.join(NOTICE)).ok()?;
    (!notice.is_empty()).then_some(notice)
}

pub fn set_notice(manifest: &Manifest, notice: &str) -> Result<(), StageError> {
    run::write(manifest.root.join(NOTICE), notice)
}

/// Publishes the last poses again. The source resumes at the newest one, and masking needs the
/// motions of all of them.
pub(crate) fn republish(
    poses: &Writer<Pose>,
    restored: &[PoseHeader],
    hop: StageId,
) -> Result<(), StageError> {
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

struct Motions {
    motions: Reader<Motion>,
    scans: Option<Reader<Masked>>,
}

impl Motions {
    fn open(launch: &Launch, next: u64, with_scans: bool) -> Result<Self, StageError> {
        // Both have the same header.
        let topic = match launch.manifest.refines {
            true => Refined::ENTRY,
            false => Motion::ENTRY,
        };
        let motions = Port::to(topic, &launch.node, &launch.manifest)?;
        let scans = with_scans.then(|| Reader::open(launch, Some(next)));
        Ok(Self {
            motions: Reader::of(motions, Some(next)),
            scans: scans.transpose()?,
        })
    }

    /// Returns the current motion, and its scan if the sink takes scans. `None`: wait.
    fn head(&mut self) -> Result<Option<Input<'_>>, StageError> {
        let Some(received) = self.motions.head()? else {
            return Ok(None);
        };
        let mut input = Input {
            motion: *received.header(),
            received_ns: received.received_ns,
            scan: None,
        };
        if let Some(scans) = &mut self.scans {
            let Some(head) = scans.head()? else {
                return Ok(None);
            };
            if head.item().seq != input.motion.item.seq {
                let expected = input.motion.item.seq;
                return Err(StageError::gap(Masked::TOPIC, expected, head.item().seq));
            }
            input.received_ns = input.received_ns.max(head.received_ns);
            input.scan = Some(head);
        }
        Ok(Some(input))
    }

    fn release(&mut self) {
        self.motions.release();
        if let Some(scans) = &mut self.scans {
            scans.release();
        }
    }

    /// Returns the listener of the input that is missing, as
    /// [`Inputs::listeners`](crate::inputs::Inputs::listeners).
    fn listener(&self) -> &Listener {
        match (&self.scans, self.motions.current()) {
            (Some(scans), Some(_)) => scans.listener(),
            _ => self.motions.listener(),
        }
    }

    fn duplicates(&self) -> u64 {
        self.motions.duplicates + self.scans.as_ref().map_or(0, |scans| scans.duplicates)
    }
}

struct Input<'a> {
    motion: MotionHeader,
    scan: Option<&'a Received<Masked>>,
    /// Time when the last of them was received, `CLOCK_MONOTONIC`, ns.
    received_ns: i64,
}

struct Integration<'a, S: Sink> {
    sink: &'a mut S,
    poses: Writer<Pose>,
    ended: bool,
    counters: StageCounters,
}

impl<S: Sink> Integration<'_, S> {
    fn drain(&mut self, inputs: &mut Motions) -> Result<bool, StageError> {
        let mut progressed = false;
        while !self.ended {
            let Some(input) = inputs.head()? else {
                break;
            };
            let item = input.motion.item;
            match item.is(flag::END) {
                true => {
                    self.sink.end(&item)?;
                    self.poses.end(item, Some(S::HOP))?;
                    self.ended = true;
                }
                false => self.integrate(input)?,
            }
            inputs.release();
            progressed = true;
        }
        Ok(progressed)
    }

    fn integrate(&mut self, input: Input<'_>) -> Result<(), StageError> {
        let work = Work::begin();
        let mut motion = input.motion;
        let hop = motion.item.hop_mut(S::HOP);
        (hop.received_ns, hop.started_ns) = (input.received_ns, work.started_ns);
        let pose = self.sink.integrate(&motion, input.scan)?;
        work.end(&mut self.counters);
        self.poses.publish(newest(pose), Some(S::HOP))
    }
}
