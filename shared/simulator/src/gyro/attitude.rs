//! The rotation and the acceleration of the vehicle: x forward, y left, z up.

use nalgebra::Vector3;

use crate::path::Path;

const GRAVITY_MPS2: f64 = 9.806_65;

/// The mean motion of the vehicle during a time, in its own axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct MeanMotion {
    pub rates_radps: Vector3<f64>,
    /// Acceleration as an accelerometer has it, with gravity: m/s².
    pub acceleration_mps2: Vector3<f64>,
}

impl MeanMotion {
    /// The mean motion along a path from one time to another, s. The rate is what turns the heading
    /// at the first into the one at the second, so that no rotation is lost.
    pub fn along(path: &dyn Path, [from_s, to_s]: [f64; 2]) -> Self {
        let duration_s = to_s - from_s;
        let [before, after] = [from_s, to_s].map(|time_s| path.pose(time_s).rotation);
        let turn_rad = before.rotation_to(&after).angle();
        let change = (path.velocity(to_s) - path.velocity(from_s)) / duration_s;
        let felt = path.pose(0.5 * (from_s + to_s)).rotation.inverse() * change;
        Self {
            rates_radps: Vector3::z() * (turn_rad / duration_s),
            acceleration_mps2: Vector3::new(felt.x, felt.y, GRAVITY_MPS2),
        }
    }
}
