//! One pass over the journal.

use std::path::Path;

use gyre_configuration::terminal::Failure;
use gyre_contract::{Item, PoseHeader, flag, run::latency::LatencyMeter};
use gyre_datasets::ground_truth::write_tum_pose;
use gyre_geometry::Pose;
use gyre_journal as journal;
use gyre_radar::Trajectory;
use gyre_storage::Draft;

use super::{Files, Slam, sketch::Sketch};
use crate::{evaluation::TimedMotion, odometry, poses, summary::Counter};

/// The most poses that are judged beside a run: they take half a gigabyte, and are 28 hours at
/// 10 Hz.
pub const MOST_JUDGED: usize = 1_000_000;

/// Writes the tables row by row, and measures and counts all else.
pub struct Pass<'a, 'b> {
    files: &'a mut Files<'b>,
    odometry: Draft,
    tum: Draft,
    poses: Draft,
    row: String,
    /// Poses of earlier sessions that are still to come.
    resumed: usize,
    is_judged: bool,
    /// The correction of the poses, and their table.
    slam: Option<(&'a Slam, Draft)>,
    read: Read,
}

#[derive(Debug, Default)]
pub struct Read {
    pub end: Option<Item>,
    pub counter: Counter,
    /// The latencies of this session only: earlier sessions may belong to a different boot with a
    /// different clock.
    pub latency: LatencyMeter,
    pub sketch: Sketch,
    /// The poses and motions to judge, half a kilobyte for each pose; else empty.
    pub trajectory: Trajectory,
    pub motions: Vec<TimedMotion>,
    pub corrected: Trajectory,
    /// True if there were more poses to judge than [`MOST_JUDGED`]: no pose is kept.
    pub are_too_many: bool,
    pub corrected_sketch: Sketch,
}

impl<'a, 'b> Pass<'a, 'b> {
    /// Starts with a journal that contains `resumed` poses of earlier sessions. Poses are kept if
    /// they are to be judged.
    pub fn new(
        files: &'a mut Files<'b>,
        resumed: usize,
        is_judged: bool,
        slam: Option<&'a Slam>,
    ) -> Result<Self, Failure> {
        let (mut odometry, mut poses) = (files.create("odometry.csv")?, files.create("poses.csv")?);
        odometry.append(odometry::HEADER)?;
        poses.append(poses::HEADER)?;
        let tum = files.create("trajectory.tum")?;
        let corrected = |slam| Ok::<_, Failure>((slam, files.create("trajectory_slam.tum")?));
        Ok(Self {
            slam: slam.map(corrected).transpose()?,
            files,
            odometry,
            tum,
            poses,
            row: String::new(),
            resumed,
            is_judged,
            read: Read::default(),
        })
    }

    fn add(&mut self, pose: &PoseHeader) -> Result<(), Failure> {
        if pose.item.is(flag::END) {
            self.read.end = Some(pose.item);
            return Ok(());
        }
        self.row.clear();
        odometry::write_row(pose, &mut self.row);
        self.odometry.append(&self.row)?;
        let place = pose.pose().motion;
        let mut line = Vec::new();
        write_tum_pose(pose.item.stamp_ns, &place, &mut line)?;
        self.tum.append(line)?;
        self.row.clear();
        poses::write_row(pose, &mut self.row);
        self.poses.append(&self.row)?;
        self.correct(pose)?;
        self.read.counter.add(pose);
        self.read.sketch.add(place);
        match self.resumed.checked_sub(1) {
            Some(left) => self.resumed = left,
            None => self.read.latency.add(pose),
        }
        if self.is_judged {
            push(&mut self.read.trajectory, pose.item.stamp_ns, place);
            self.read.motions.extend(odometry::motion(pose));
            self.let_go_of_too_many();
        }
        Ok(())
    }

    fn correct(&mut self, pose: &PoseHeader) -> Result<(), Failure> {
        let Some((slam, tum)) = &mut self.slam else {
            return Ok(());
        };
        let stamp_ns = pose.item.stamp_ns;
        let corrected = slam.correct(pose.item.seq, &pose.pose().motion);
        let mut line = Vec::new();
        write_tum_pose(stamp_ns, &corrected, &mut line)?;
        self.read.corrected_sketch.add(corrected);
        if self.is_judged {
            push(&mut self.read.corrected, stamp_ns, corrected);
        }
        Ok(tum.append(line)?)
    }

    fn let_go_of_too_many(&mut self) {
        let read = &mut self.read;
        if read.trajectory.poses.len() > MOST_JUDGED {
            (read.trajectory, read.motions, read.corrected) = Default::default();
            (read.are_too_many, self.is_judged) = (true, false);
        }
    }

    /// Reads the journal of a run to its end.
    pub fn over(mut self, out: &Path) -> Result<Read, Failure> {
        for pose in journal::poses(out)? {
            self.add(&pose?)?;
        }
        self.files.push(self.odometry);
        self.files.push(self.tum);
        self.files.push(self.poses);
        if let Some((_, tum)) = self.slam {
            self.files.push(tum);
        }
        Ok(self.read)
    }
}

fn push(trajectory: &mut Trajectory, stamp_ns: i64, pose: Pose) {
    trajectory.stamp_ns.get_or_insert_default().push(stamp_ns);
    trajectory.poses.push(pose);
}
