//! One road user.

use gyre_geometry::Pose;
use nalgebra::Vector2;

use super::own_way::OwnWay;
use super::track::Track;
use crate::body::Body;

/// Half of the driven vehicle's length and width, metres, with the sensor in its middle.
pub const OWN_HALF_M: (f64, f64) = (2.2, 0.9);

/// A road user.
#[derive(Debug)]
pub struct Actor {
    pub body: Body,
    pub half_m: (f64, f64),
    /// From when until when it can be around, seconds.
    pub shown_s: [f64; 2],
    pub track: Track,
}

impl Actor {
    pub fn is_shown(&self, time_s: f64) -> bool {
        (self.shown_s[0]..=self.shown_s[1]).contains(&time_s)
    }

    /// Metres a second in the world, from where it is a millisecond before and after; off by less than 0.1 mm/s.
    pub fn velocity(&self, way: &OwnWay, time_s: f64, pose: &Pose) -> Vector2<f64> {
        let half_s = 1e-3;
        let [before, after] =
            [time_s - half_s, time_s + half_s].map(|time_s| self.track.pose(way, time_s));
        // One side is missing in the instant in which it appears or leaves.
        let sides = f64::from(u8::from(before.is_some()) + u8::from(after.is_some()));
        let [from, to] = [before.unwrap_or(*pose), after.unwrap_or(*pose)];
        (to.translation.vector - from.translation.vector) / (sides.max(1.0) * half_s)
    }

    /// Whether it would be inside the driven vehicle: where the way turns back on itself no lane is its own.
    pub fn runs_into(&self, own: &Pose, pose: &Pose) -> bool {
        let seen = own.inverse() * pose;
        let (cosine, sine) = (
            seen.rotation.cos_angle().abs(),
            seen.rotation.sin_angle().abs(),
        );
        let length_m = OWN_HALF_M.0 + self.half_m.0 * cosine + self.half_m.1 * sine;
        let width_m = OWN_HALF_M.1 + self.half_m.1 * cosine + self.half_m.0 * sine;
        seen.translation.x.abs() < length_m && seen.translation.y.abs() < width_m
    }
}
