//! How the sensor moves: a pose for every instant.

mod block;
pub mod recorded;
pub mod spline;
mod timed_poses;
mod town_drive;
mod twist;

use nalgebra::{Isometry2, Vector2};

pub use block::BlockLoop;
pub use timed_poses::TimedPoses;
pub use town_drive::TownDrive;
pub use twist::ConstantTwist;

/// A motion that is continuous in time.
pub trait Trajectory: Send + Sync {
    /// Pose of the sensor (x forward, y left, yaw counter-clockwise) in the world at `time_s` seconds after the start.
    ///
    /// Defined for every time: a drive that ends stands still before its start and after its end.
    fn pose(&self, time_s: f64) -> Isometry2<f64>;

    /// How long the drive lasts, seconds; infinite where it goes on for ever.
    fn duration_s(&self) -> f64 {
        f64::INFINITY
    }

    /// Velocity of the sensor in the world at a time, metres a second.
    fn velocity(&self, time_s: f64) -> Vector2<f64> {
        let half_s = 0.5e-3;
        (self.pose(time_s + half_s).translation.vector
            - self.pose(time_s - half_s).translation.vector)
            / (2.0 * half_s)
    }
}
