//! The poses and motions that are evaluated against ground truth.

use gyre_evaluation::TimedMotion;
use gyre_messages::PoseHeader;
use gyre_radar::Trajectory;
use gyre_terminal::Failure;

use crate::odometry;

/// An evaluation takes about 0.5 kB of memory a pose: this many take half a gigabyte, and are 28
/// hours at 10 Hz.
const MOST: usize = 1_000_000;

#[derive(Debug, Default)]
pub struct Estimate {
    pub trajectory: Trajectory,
    pub motions: Vec<TimedMotion>,
    pub poses: usize,
}

impl Estimate {
    /// Adds the next pose. All are let go when there are too many.
    pub fn add(&mut self, pose: &PoseHeader) {
        self.poses += 1;
        if self.poses > MOST {
            (self.trajectory, self.motions) = Default::default();
            return;
        }
        let stamps = self.trajectory.stamp_ns.get_or_insert_default();
        stamps.push(pose.item.stamp_ns);
        self.trajectory.poses.push(pose.pose().motion);
        self.motions.extend(odometry::motion(pose));
    }

    pub fn require_all(&self) -> Result<(), Failure> {
        match self.poses <= MOST {
            true => Ok(()),
            false => Err(format!(
                "{} poses are too many to keep in memory beside a run, at most {MOST}: use gyre evaluate",
                self.poses
            )
            .into()),
        }
    }
}
