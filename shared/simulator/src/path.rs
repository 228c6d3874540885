mod block;
pub mod recorded;
pub mod spline;
mod spline_path;

pub use block::BlockLoop;
pub use spline_path::SplinePath;

use gyre_geometry::{Pose, Twist};
use nalgebra::Vector2;

pub trait Path: Send + Sync {
    /// Pose of the sensor (x forward, y left, yaw counter-clockwise) in the world at `time_s`
    /// seconds after the start; a path of finite duration stands still before and after.
    fn pose(&self, time_s: f64) -> Pose;

    /// Duration, seconds; infinite for an endless path.
    fn duration_s(&self) -> f64 {
        f64::INFINITY
    }

    /// Duration of a lap, seconds, of a path that repeats itself.
    fn lap_s(&self) -> Option<f64> {
        None
    }

    /// Velocity of the sensor in the world at a time, metres a second.
    fn velocity(&self, time_s: f64) -> Vector2<f64> {
        let half_s = 0.5e-3;
        (self.pose(time_s + half_s).translation.vector
            - self.pose(time_s - half_s).translation.vector)
            / (2.0 * half_s)
    }
}

/// A constant velocity, from the world's origin at time zero.
impl Path for Twist {
    fn pose(&self, time_s: f64) -> Pose {
        self.pose_at(time_s)
    }
}
