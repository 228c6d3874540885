//! One pass over the journal.

use std::path::Path;

use gyre_configuration::terminal::Failure;
use gyre_contract::{Item, flag, run::latency::LatencyMeter};
use gyre_datasets::ground_truth::write_tum_pose;
use gyre_geometry::Pose;
use gyre_journal as journal;
use gyre_radar::Trajectory;

use super::{Files, Slam, sketch::Sketch};
use crate::{evaluation::TimedMotion, odometry, poses, summary::Counter};

/// The most poses that are judged beside a run: they take half a gigabyte, and are 28 hours at
/// 10 Hz.
pub const MOST_JUDGED: usize = 1_000_000;

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

/// Reads the journal of a run to its end, which contains `resumed` poses of earlier sessions:
/// writes the tables row by row, and measures and counts all else. Poses are kept if they are to be
/// compared with a ground truth or with loops.
pub fn read(
    files: &mut Files<'_>,
    out: &Path,
    mut resumed: usize,
    mut is_judged: bool,
    slam: Option<&Slam>,
) -> Result<Read, Failure> {
    let (mut odometry, mut poses) = (files.create("odometry.csv")?, files.create("poses.csv")?);
    odometry.append(odometry::HEADER)?;
    poses.append(poses::HEADER)?;
    let mut tum = files.create("trajectory.tum")?;
    let corrected_tum = slam.map(|_| files.create("trajectory_slam.tum"));
    let mut corrected_tum = corrected_tum.transpose()?;
    let (mut read, mut row) = (Read::default(), String::new());
    for pose in journal::poses(out)? {
        let pose = &pose?;
        if pose.item.is(flag::END) {
            read.end = Some(pose.item);
            continue;
        }
        let (stamp_ns, place) = (pose.item.stamp_ns, pose.pose().motion);
        row.clear();
        odometry::write_row(pose, &mut row);
        odometry.append(&row)?;
        tum.append(tum_line(stamp_ns, &place)?)?;
        row.clear();
        poses::write_row(pose, &mut row);
        poses.append(&row)?;
        let corrected = slam.map(|slam| slam.correct(pose.item.seq, &place));
        if let (Some(corrected), Some(tum)) = (corrected, &mut corrected_tum) {
            tum.append(tum_line(stamp_ns, &corrected)?)?;
            read.corrected_sketch.add(corrected);
        }
        read.counter.add(pose);
        read.sketch.add(place);
        match resumed.checked_sub(1) {
            Some(left) => resumed = left,
            None => read.latency.add(pose),
        }
        if is_judged {
            push(&mut read.trajectory, stamp_ns, place);
            read.motions.extend(odometry::motion(pose));
            if let Some(corrected) = corrected {
                push(&mut read.corrected, stamp_ns, corrected);
            }
            is_judged = read.let_go_of_too_many();
        }
    }
    let tables = [odometry, tum, poses];
    let tables = tables.into_iter().chain(corrected_tum);
    tables.for_each(|table| files.push(table));
    Ok(read)
}

impl Read {
    /// Returns whether the poses so far are few enough to be judged.
    fn let_go_of_too_many(&mut self) -> bool {
        self.are_too_many = self.trajectory.poses.len() > MOST_JUDGED;
        if self.are_too_many {
            (self.trajectory, self.motions, self.corrected) = Default::default();
        }
        !self.are_too_many
    }
}

fn tum_line(stamp_ns: i64, pose: &Pose) -> Result<Vec<u8>, Failure> {
    let mut line = Vec::new();
    write_tum_pose(stamp_ns, pose, &mut line)?;
    Ok(line)
}

fn push(trajectory: &mut Trajectory, stamp_ns: i64, pose: Pose) {
    trajectory.stamp_ns.get_or_insert_default().push(stamp_ns);
    trajectory.poses.push(pose);
}
