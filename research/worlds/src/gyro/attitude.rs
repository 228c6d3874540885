//! The rotation and the acceleration of the vehicle: x forward, y left, z up.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{Point2, UnitQuaternion, Vector2, Vector3};

use super::MeanMotion;
use crate::path::Path;
use crate::relief::Relief;
use crate::sensor::PitchRoll;

/// Standard gravity, m/s².
const GRAVITY_MPS2: f64 = 9.806_65;

/// A vehicle on its path: it follows the hills, and pitches and rolls as the radar's beam does.
pub(crate) struct Vehicle<'a> {
    path: &'a dyn Path,
    relief: Relief,
    pitch_roll: Option<PitchRoll>,
}

impl<'a> Vehicle<'a> {
    /// A vehicle whose pitch and roll on its springs are `pitch_roll`, if it has any.
    pub fn new(path: &'a dyn Path, relief: Relief, pitch_roll: Option<PitchRoll>) -> Self {
        Self {
            path,
            relief,
            pitch_roll,
        }
    }

    /// The mean motion from one time of the drive to another, s. The rates are what turns the
    /// attitude at the first into that at the second, so that no rotation is lost.
    pub(super) fn mean_motion(&self, [from_s, to_s]: [f64; 2]) -> MeanMotion {
        let [before, after] = [from_s, to_s].map(|time_s| self.attitude(time_s));
        let duration_s = to_s - from_s;
        let [slow, fast] = [from_s, to_s].map(|time_s| self.velocity(time_s, duration_s));
        let felt = (fast - slow) / duration_s + Vector3::z() * GRAVITY_MPS2;
        MeanMotion {
            rates_radps: (before.inverse() * after).scaled_axis() / duration_s,
            acceleration_mps2: before.slerp(&after, 0.5).inverse() * felt,
        }
    }

    /// Rotates from the vehicle's axes to the world's.
    fn attitude(&self, time_s: f64) -> UnitQuaternion<f64> {
        let pose = self.path.pose(time_s);
        // Azimuths are clockwise.
        let rises = [(Vector2::x(), 0.0), (Vector2::y(), -FRAC_PI_2)].map(|(axis, azimuth_rad)| {
            let place = Point2::from(pose.translation.vector);
            let nod = |nods: &PitchRoll| nods.elevation_rad(time_s, azimuth_rad);
            self.relief.slope_rad(place, pose.rotation * axis)
                + self.pitch_roll.as_ref().map_or(0.0, nod)
        });
        // A rotation about y lowers what is ahead, one about x raises what is left.
        UnitQuaternion::from_euler_angles(rises[1], -rises[0], pose.rotation.angle())
    }

    /// Velocity in the world, m/s; the vertical one is the mean over `duration_s`.
    fn velocity(&self, time_s: f64, duration_s: f64) -> Vector3<f64> {
        let level = self.path.velocity(time_s);
        let at = [-0.5, 0.5].map(|share| self.path.pose(time_s + share * duration_s));
        let [from, to] = at.map(|pose| Point2::from(pose.translation.vector));
        Vector3::new(level.x, level.y, self.relief.rise_m(from, to) / duration_s)
    }
}
