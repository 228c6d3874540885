//! The poses of a run's keyframes on a map.

use std::path::{Path, PathBuf};

use gyre_configuration::terminal::Failure;
use gyre_datasets::ground_truth::{read_trajectory, read_trajectory_of_run};
use gyre_geometry::Pose;
use gyre_radar::Trajectory;
use gyre_slam::Keyframe;

use super::trajectory_of;

pub struct Poses {
    pub path: PathBuf,
    /// The run's own trajectory has the numbers of its scans as times: its clock may step back.
    trajectory: Trajectory,
    is_of_run: bool,
}

impl Poses {
    /// Reads the trajectory of a run, or a different trajectory of the same drive, which has times.
    pub fn read(run: &Path, other: Option<&PathBuf>) -> Result<Self, Failure> {
        let path = other.cloned().unwrap_or_else(|| trajectory_of(run));
        let trajectory = match other {
            Some(_) => read_trajectory(&path)?,
            None => {
                let poses = read_trajectory_of_run(&path)?.poses;
                Trajectory::timed((0..).take(poses.len()).collect(), poses)
            }
        };
        Ok(Self {
            path,
            trajectory,
            is_of_run: other.is_none(),
        })
    }

    /// Returns the number or the time of a keyframe.
    pub fn key(&self, keyframe: &Keyframe) -> i64 {
        match self.is_of_run {
            true => keyframe.seq as i64,
            false => keyframe.stamp_ns,
        }
    }

    pub fn of(&self, keyframe: &Keyframe) -> Option<Pose> {
        let rounding_ns = if self.is_of_run {
            0
        } else {
            Trajectory::ROUNDING_NS
        };
        self.trajectory.near(self.key(keyframe), rounding_ns)
    }

    /// Returns the poses from the first to the last keyframe, by their keys: a ground truth may be
    /// of a longer drive.
    pub fn part(&self, (first, last): (i64, i64)) -> Vec<Pose> {
        let keys = self.trajectory.stamps().iter();
        let poses = keys.zip(&self.trajectory.poses);
        let poses = poses.filter(|(key, _)| (first..=last).contains(*key));
        poses.map(|(_, pose)| *pose).collect()
    }
}
