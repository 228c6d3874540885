//! Moving objects: follows `journal/scans.log`, and keeps the objects of each scan in
//! `journal/objects.log`. A restarted process works through the scans from the first one, since an
//! identity can be as old as the run, and appends the records that the log lacks.

use gyre_contract::{
    Command, CommandsOfScans, Item, MAX_LISTED, Object, Objects, ObjectsHeader, run::StageCounters,
};
use gyre_geometry::xy_yaw;
use gyre_journal::{objects::LoggedObjects, scans::LoggedScan};
use gyre_masking::MaskingConfig;
use gyre_objects::{ObjectTracker, PlacedScan};
use gyre_slam::{RecordLog, RecordReader};
use gyre_stage::{
    Follower, Launch,
    follower::{self, Progress, Step},
};
use gyre_transport::{RunError, services::LogId};
use nalgebra::Vector2;

pub fn run(launch: &Launch) -> Result<StageCounters, RunError> {
    launch.take_place()?;
    let masking: MaskingConfig = launch.section("masking")?;
    let out = &launch.manifest.out;
    let mut tracking = Tracking {
        scans: RecordReader::open(out)?,
        tracked: RecordLog::open(out)?,
        tracker: tracker(&masking)?,
        commands: CommandsOfScans::open(out).map_err(RunError::input)?,
        masking,
        read: 0,
    };
    let (scans, tracked) = (&tracking.scans, &mut tracking.tracked);
    if !scans.has_ended() || tracked.len() > scans.len() {
        tracked.cut(scans.len())?;
    }
    follower::run(launch, &mut tracking)
}

pub fn tracker(masking: &MaskingConfig) -> Result<ObjectTracker, RunError> {
    let runtime = masking.onnx_runtime().map_err(RunError::input)?;
    ObjectTracker::new(runtime.as_deref()).map_err(RunError::input)
}

struct Tracking {
    masking: MaskingConfig,
    scans: RecordReader<LoggedScan>,
    tracked: RecordLog<LoggedObjects>,
    tracker: ObjectTracker,
    commands: CommandsOfScans,
    read: usize,
}

impl Tracking {
    /// Looks for new scans. If some of the scans that were read have been cut off, it restarts from
    /// the first scan.
    fn look(&mut self) -> Result<(), RunError> {
        self.scans.refresh()?;
        if self.scans.unchanged() < self.read {
            self.tracked.cut(self.scans.unchanged())?;
            self.tracker = tracker(&self.masking)?;
            self.commands.restart();
            self.read = 0;
        }
        Ok(())
    }

    /// Tracks the objects of the next scan. Returns the message about it, unless the log has them.
    fn track_next(&mut self) -> Result<Option<ObjectsHeader>, RunError> {
        let scan = self.scans.read(self.read)?;
        let new = self.commands.of_scan(scan.stamp_ns);
        if new.map_err(RunError::input)?.any(Command::starts_chain) {
            self.tracker.end_tracks();
        }
        let placed = PlacedScan {
            stamp_ns: scan.stamp_ns,
            pose: scan.pose,
            twist: scan.twist,
        };
        let objects = self
            .tracker
            .update(&placed, &scan.points)
            .map_err(RunError::input)?;
        let known = self.read < self.tracked.len();
        self.read += 1;
        if known {
            return Ok(None);
        }
        let header = header(&scan, objects);
        self.tracked.append(&LoggedObjects {
            seq: scan.seq,
            scan: scan.scan,
            stamp_ns: scan.stamp_ns,
            objects: objects.to_vec(),
        })?;
        Ok(Some(header))
    }
}

fn header(scan: &LoggedScan, objects: &[Object]) -> ObjectsHeader {
    let [x_m, y_m, yaw_rad] = xy_yaw(&scan.pose);
    let mut header = ObjectsHeader {
        item: Item::recorded(scan.seq, scan.scan, scan.stamp_ns),
        x_m,
        y_m,
        yaw_rad,
        objects: objects.len() as u64,
        moving: objects.iter().filter(|it| it.is_moving()).count() as u64,
        listed: objects.len().min(MAX_LISTED) as u64,
        ..ObjectsHeader::default()
    };
    let here = scan.pose.translation.vector;
    let away_m = |it: &Object| (Vector2::new(it.x_m, it.y_m) - here).norm();
    let mut nearest = objects.to_vec();
    nearest.sort_by(|a, b| away_m(a).total_cmp(&away_m(b)));
    nearest.truncate(MAX_LISTED);
    header.list[..nearest.len()].copy_from_slice(&nearest);
    header
}

impl Follower for Tracking {
    type Output = Objects;
    const LOGS: &'static [LogId] = &[LogId::Scans];

    fn step(&mut self) -> Result<Step<ObjectsHeader>, RunError> {
        self.look()?;
        if self.read < self.scans.len() {
            return Ok(Step::Worked(self.track_next()?));
        }
        if !self.scans.has_ended() {
            return Ok(Step::Idle);
        }
        self.tracked.end()?;
        Ok(Step::Ended)
    }

    fn sync(&mut self) -> Result<(), RunError> {
        Ok(self.tracked.sync()?)
    }

    fn progress(&self) -> Progress {
        Progress::of(self.read, self.scans.len())
    }
}
