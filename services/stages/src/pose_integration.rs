//! The pose-integration stage: composes motions and their covariances to poses, and journals each
//! pose before it is published. A reset by a command begins at its pose. With SLAM it logs
//! keyframes, with objects each scan. In live mode poses continue when the disk is full, and are
//! held in memory until there is room.

use gyre_contract::{
    Command, Commands, Item, Masked, MotionHeader, PoseHeader, StageId, compose, flag,
    run::StageCounters,
};
use gyre_geometry::{covariance, xy_yaw};
use gyre_journal::{Journal, PoseLog, keyframes::Keyframes, scans::Scans};
use gyre_objects::ObjectsConfig;
use gyre_slam::SlamConfig;
use gyre_stage::{Launch, Sink, sink};
use gyre_storage::{Disk, continue_when_full, disk};
use gyre_transport::{
    Manifest, RunError, clock, reader::Received, services::LogId, transport::Notifier,
};

use crate::{points, unusable};

pub fn run(launch: &Launch) -> Result<StageCounters, RunError> {
    launch.take_place()?;
    let out = &launch.manifest.out;
    if let Some(notice) = sink::notice(&launch.manifest) {
        let loss = format!("{notice}; the process that held them has died, and they are lost");
        return Err(sink::poses_lost(&launch.manifest, loss));
    }
    if launch.manifest.live {
        continue_when_full();
    }
    let slam: SlamConfig = launch.section("slam")?;
    let objects: ObjectsConfig = launch.section("objects")?;
    let mut journal = Journal::open(out).map_err(unusable)?;
    let (newest, ended) = journal.last(1).map_err(unusable)?;
    let last = newest.last().copied();
    let known = last.map_or(0, |last| last.item.seq.saturating_add(1));
    let points = launch.manifest.limits.points;
    let mut logs: Vec<(Box<dyn PoseLog>, Notifier)> = Vec::new();
    if slam.is_on() {
        let keyframes = Keyframes::open(out, known, ended, points).map_err(unusable)?;
        logs.push((Box::new(keyframes), LogId::Keyframes.growth(&launch.node)?));
    }
    if objects.is_on() {
        let scans = Scans::open(out, known, ended, points).map_err(unusable)?;
        logs.push((Box::new(scans), LogId::Scans.growth(&launch.node)?));
    }
    let mut integration = Integration {
        journal,
        commands: Commands::open(out).map_err(RunError::input)?,
        last,
        logs,
        held_from: None,
        lost_from: None,
        manifest: launch.manifest.clone(),
    };
    let counters = sink::run(launch, &mut integration)?;
    integration.sync()?;
    integration.require_kept()?;
    Ok(counters)
}

struct Integration {
    journal: Journal,
    commands: Commands,
    last: Option<PoseHeader>,
    /// The logs that the run has, and what wakes the followers of each.
    logs: Vec<(Box<dyn PoseLog>, Notifier)>,
    manifest: Manifest,
    /// The first pose since the disk is full, and the first one that is lost because the memory for
    /// them is used up.
    held_from: Option<u64>,
    lost_from: Option<u64>,
}

impl Sink for Integration {
    const HOP: StageId = StageId::PoseIntegration;

    fn takes_scans(&self) -> bool {
        !self.logs.is_empty()
    }

    fn restore(&mut self, count: usize) -> Result<(Vec<PoseHeader>, bool), RunError> {
        self.journal.last(count).map_err(unusable)
    }

    fn integrate(
        &mut self,
        motion: &MotionHeader,
        scan: Option<&Received<Masked>>,
    ) -> Result<PoseHeader, RunError> {
        self.obey(&motion.item)?;
        let mut pose = compose(self.last.as_ref(), motion);
        pose.item.hop_mut(Self::HOP).finished_ns = clock::now_ns();
        if let Some(scan) = scan {
            let points = points(scan)?;
            for (log, growth) in &mut self.logs {
                if log.add(&pose, points).map_err(unusable)? {
                    growth.notify()?;
                }
            }
        }
        self.journal.append(&pose).map_err(unusable)?;
        self.last = Some(pose);
        self.look_at_disk(pose.item.seq)?;
        Ok(pose)
    }

    fn end(&mut self, item: &Item) -> Result<(), RunError> {
        for (log, growth) in &mut self.logs {
            log.end().map_err(unusable)?;
            growth.notify()?;
        }
        let end = PoseHeader {
            item: item.flagged(flag::END),
            ..PoseHeader::default()
        };
        self.journal.append(&end).map_err(unusable)?;
        // Once the end is published, the run is complete.
        self.sync()?;
        self.require_kept()
    }
}

impl Integration {
    /// Applies the commands that are new with a scan.
    fn obey(&mut self, item: &Item) -> Result<(), RunError> {
        let before = self.last.map_or(0, |last| last.item.commands);
        if item.commands == before {
            return Ok(());
        }
        self.commands.refresh().map_err(RunError::input)?;
        if self.commands.len() < item.commands {
            let (seq, commands) = (item.seq, item.commands);
            return Err(RunError::Input(format!(
                "scan {seq} has {commands} commands, but journal/commands.jsonl has fewer"
            )));
        }
        for command in self.commands.between(before, item.commands) {
            for (log, _) in &mut self.logs {
                log.obey(command).map_err(unusable)?;
            }
            if let Command::Reset { at, .. } = command {
                let start = self.last.get_or_insert_default();
                let given = at.pose();
                [start.x_m, start.y_m, start.yaw_rad] = xy_yaw(&given.motion);
                start.covariance = covariance::pack(&given.covariance);
                start.accumulated_covariance = start.covariance;
            }
        }
        Ok(())
    }

    /// Waits until all that was written survives a power failure: a failure is found by nobody
    /// after this process.
    fn sync(&self) -> Result<(), RunError> {
        let mut logs = self.logs.iter();
        logs.try_for_each(|(log, _)| log.sync()).map_err(unusable)?;
        self.journal.sync().map_err(unusable)
    }

    /// Reports when the disk is full, and when it has room again. If poses were lost meanwhile, the
    /// run has to begin again behind those that it has kept.
    fn look_at_disk(&mut self, seq: u64) -> Result<(), RunError> {
        let out = self.manifest.out.display();
        let notice = match (disk(), self.held_from, self.lost_from) {
            (Disk::IsFull, None, _) => {
                self.held_from = Some(seq);
                format!(
                    "the disk of {out} is full: poses continue, and those from pose {seq} on are held in memory until there is room"
                )
            }
            (Disk::Lost(false), _, None) => {
                self.lost_from = Some(seq);
                format!(
                    "the disk of {out} is full, and the memory for poses too: poses continue, but those from pose {seq} on are lost"
                )
            }
            (Disk::Lost(true), ..) => return Err(sink::poses_lost(&self.manifest, self.loss())),
            (Disk::HasRoom, Some(first), _) => {
                self.held_from = None;
                tracing::info!("the disk has room again, and has poses {first} to {seq}");
                String::new()
            }
            _ => return Ok(()),
        };
        sink::set_notice(&self.manifest, &notice)
    }

    fn require_kept(&self) -> Result<(), RunError> {
        match disk() {
            Disk::HasRoom => sink::set_notice(&self.manifest, ""),
            Disk::IsFull | Disk::Lost(_) => Err(RunError::Input(self.loss())),
        }
    }

    fn loss(&self) -> String {
        let first = match disk() {
            Disk::Lost(true) => self.lost_from,
            _ => self.held_from,
        };
        let (out, last) = (self.manifest.out.display(), self.last.map(|it| it.item.seq));
        let (first, last) = (first.or(last).unwrap_or_default(), last.unwrap_or_default());
        format!("the disk of {out} was full: poses {first} to {last} are lost, and in no result")
    }
}
