//! The pose-integration stage: composes motions and their covariances to poses, and journals each
//! pose before it is published. With SLAM it logs keyframes, with objects each scan. In live mode
//! poses continue when the disk is full, and are not kept from then on.

use std::fmt::Display;

use gyre_journal::{
    self as journal, Journal, JournalError,
    keyframes::{Keyframes, KeyframesError},
    scans::{Scans, ScansError},
};
use gyre_messages::{Item, Masked, MotionHeader, PoseHeader, StageId, compose, flag};
use gyre_objects::ObjectsConfig;
use gyre_slam::SlamConfig;
use gyre_stage::{
    Launch, Manifest, Sink, StageCounters, StageError, clock,
    follower::{Growth, LogId},
    reader::Received,
    sink,
};
use gyre_storage::{LogError, continue_when_full, was_full};

use crate::points;

pub fn run(launch: &Launch) -> Result<StageCounters, StageError> {
    launch.take_place()?;
    let out = &launch.manifest.out;
    if launch.manifest.live {
        continue_when_full();
    }
    let slam: SlamConfig = launch.section("slam")?;
    let objects: ObjectsConfig = launch.section("objects")?;
    let growth = |is_on: bool, log| is_on.then(|| Growth::of(launch, log)).transpose();
    let mut integration = Integration {
        journal: Journal::open(&journal::path(out)).map_err(unusable)?,
        last: None,
        keyframes_grown: growth(slam.is_on(), LogId::Keyframes)?,
        scans_grown: growth(objects.is_on(), LogId::Scans)?,
        slam,
        objects,
        points: launch.manifest.limits.points,
        keyframes: None,
        scans: None,
        // A stage that died on the full disk has left it.
        loss: sink::notice(&launch.manifest),
        manifest: launch.manifest.clone(),
    };
    let counters = sink::run(launch, &mut integration)?;
    integration.sync()?;
    integration.require_kept()?;
    Ok(counters)
}

struct Integration {
    journal: Journal,
    last: Option<PoseHeader>,
    slam: SlamConfig,
    objects: ObjectsConfig,
    points: usize,
    /// Of a run with SLAM, from [`Sink::restore`] on.
    keyframes: Option<Keyframes>,
    scans: Option<Scans>,
    /// Wake the followers of the logs that the run has.
    keyframes_grown: Option<Growth>,
    scans_grown: Option<Growth>,
    manifest: Manifest,
    /// The sentence about the poses that are not kept.
    loss: Option<String>,
}

impl Sink for Integration {
    const HOP: StageId = StageId::PoseIntegration;

    fn takes_scans(&self) -> bool {
        self.slam.is_on() || self.objects.is_on()
    }

    fn restore(&mut self, count: usize) -> Result<(Vec<PoseHeader>, bool), StageError> {
        // At least one pose, to continue from.
        let (mut poses, ended) = self.journal.last(count.max(1)).map_err(unusable)?;
        self.last = poses.last().copied();
        poses.drain(..poses.len().saturating_sub(count));
        let known = self.last.map_or(0, |last| last.item.seq.saturating_add(1));
        if self.slam.is_on() {
            let keyframes = Keyframes::open(&self.manifest.out, known, ended);
            let keyframes = keyframes.map_err(unusable_keyframes)?;
            self.keyframes.insert(keyframes).reserve(self.points);
        }
        if self.objects.is_on() {
            let scans = Scans::open(&self.manifest.out, known, ended).map_err(unusable_scans)?;
            self.scans.insert(scans).reserve(self.points);
        }
        Ok((poses, ended))
    }

    fn integrate(
        &mut self,
        motion: &MotionHeader,
        scan: Option<&Received<Masked>>,
    ) -> Result<PoseHeader, StageError> {
        let mut pose = compose(self.last.as_ref(), motion);
        pose.item.hop_mut(Self::HOP).finished_ns = clock::now_ns();
        if let (Some(keyframes), Some(scan)) = (&mut self.keyframes, scan) {
            let added = keyframes.add(&pose, points(scan)?);
            if added.map_err(unusable_keyframes)? {
                self.keyframes_grown.iter().try_for_each(Growth::notify)?;
            }
        }
        if let (Some(scans), Some(scan)) = (&mut self.scans, scan) {
            scans.add(&pose, points(scan)?).map_err(unusable_scans)?;
            self.scans_grown.iter().try_for_each(Growth::notify)?;
        }
        self.journal.append(&pose).map_err(unusable)?;
        if was_full() && self.loss.is_none() {
            let (out, seq) = (self.manifest.out.display(), pose.item.seq);
            let loss = format!(
                "the disk of {out} is full: poses continue, but those from pose {seq} on are not kept: they are in no result, and the run can be resumed only from those before"
            );
            sink::set_notice(&self.manifest, &loss)?;
            self.loss = Some(loss);
        }
        self.last = Some(pose);
        Ok(pose)
    }

    fn end(&mut self, item: &Item) -> Result<(), StageError> {
        if let Some(keyframes) = &mut self.keyframes {
            keyframes.end().map_err(unusable_keyframes)?;
            self.keyframes_grown.iter().try_for_each(Growth::notify)?;
        }
        if let Some(scans) = &mut self.scans {
            scans.end().map_err(unusable_scans)?;
            self.scans_grown.iter().try_for_each(Growth::notify)?;
        }
        let end = PoseHeader {
            item: item.flagged(flag::END),
            ..PoseHeader::default()
        };
        self.journal.append(&end).map_err(unusable)?;
        self.require_kept()?;
        // Once the end is published, the run is complete.
        self.sync()
    }
}

impl Integration {
    /// Waits until all that was written survives a power failure: a failure is found by nobody
    /// after this process.
    fn sync(&self) -> Result<(), StageError> {
        if let Some(keyframes) = &self.keyframes {
            keyframes.sync().map_err(unusable_keyframes)?;
        }
        if let Some(scans) = &self.scans {
            scans.sync().map_err(unusable_scans)?;
        }
        self.journal.sync().map_err(unusable)
    }

    fn require_kept(&self) -> Result<(), StageError> {
        let (Some(loss), Some(last)) = (&self.loss, self.last) else {
            return Ok(());
        };
        let seq = last.item.seq;
        Err(StageError::Input(format!("{loss}; the last pose is {seq}")))
    }
}

fn unusable(error: JournalError) -> StageError {
    failed(matches!(error, JournalError::Busy(_)), "journal", &error)
}

fn unusable_keyframes(error: KeyframesError) -> StageError {
    let is_busy = matches!(error, KeyframesError::Log(LogError::Busy(_)));
    failed(is_busy, "keyframes", &error)
}

fn unusable_scans(error: ScansError) -> StageError {
    let is_busy = matches!(error, ScansError::Log(LogError::Busy(_)));
    failed(is_busy, "scans", &error)
}

/// The error for a file: a process that was killed, and is not gone yet, may have it.
fn failed(is_busy: bool, file: &str, error: &dyn Display) -> StageError {
    match is_busy {
        true => StageError::Transient(format!("cannot open the {file}: {error}")),
        false => StageError::Input(error.to_string()),
    }
}
