//! The poses at which the keyframes of a run are drawn.

use std::path::{Path, PathBuf};

use gyre_configuration::terminal::Failure;
use gyre_datasets::ground_truth::{read_trajectory, read_trajectory_of_run};
use gyre_geometry::Pose;
use gyre_radar::Trajectory;
use gyre_slam::Keyframe;

use super::trajectory_of;

pub struct Poses {
    pub path: PathBuf,
    /// The run's own has the numbers of its scans for times: its clock may step back.
    trajectory: Trajectory,
    is_of_run: bool,
}

impl Poses {
    pub fn of_run(run: &Path) -> Result<Self, Failure> {
        let path = trajectory_of(run);
        let poses = read_trajectory_of_run(&path)?.poses;
        let numbers = (0..).take(poses.len()).collect();
        Ok(Self {
            trajectory: Trajectory::timed(numbers, poses),
            path,
            is_of_run: true,
        })
    }

    /// Another trajectory of the same drive, by time.
    pub fn of_other(path: &Path) -> Result<Self, Failure> {
        Ok(Self {
            trajectory: read_trajectory(path)?,
            path: path.to_owned(),
            is_of_run: false,
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
        let key = self.key(keyframe);
        match self.is_of_run {
            true => self.trajectory.at(key),
            false => self.trajectory.near(key, Trajectory::ROUNDING_NS),
        }
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
