//! One road user.

use gyre_geometry::Pose;
use nalgebra::Vector2;

use super::ego_route::EgoRoute;
use super::kind::Kind;
use super::track::Track;
use crate::body::Body;

/// Half of the ego vehicle's length and width, metres, with the sensor in its centre.
pub const EGO_HALF_M: (f64, f64) = (2.2, 0.9);

/// A road user.
#[derive(Debug)]
pub struct Actor {
    pub kind: Kind,
    pub body: Body,
    pub half_m: (f64, f64),
    /// First and last time at which it can be visible, seconds.
    pub visible_s: [f64; 2],
    pub track: Track,
}

impl Actor {
    pub fn is_visible(&self, time_s: f64) -> bool {
        (self.visible_s[0]..=self.visible_s[1]).contains(&time_s)
    }

    /// Velocity in the world, metres a second, by a difference quotient over 2 ms; accurate to 0.1
    /// mm/s.
    pub fn velocity(&self, route: &EgoRoute, time_s: f64, pose: &Pose) -> Vector2<f64> {
        let half_s = 1e-3;
        let [before, after] =
            [time_s - half_s, time_s + half_s].map(|time_s| self.track.pose(route, time_s));
        // At the first and the last instant only one side exists.
        let sides = f64::from(u8::from(before.is_some()) + u8::from(after.is_some()));
        let [from, to] = [before.unwrap_or(*pose), after.unwrap_or(*pose)];
        (to.translation.vector - from.translation.vector) / (sides.max(1.0) * half_s)
    }

    /// Returns whether it overlaps the ego vehicle, as can happen where the route turns back on
    /// itself.
    pub fn overlaps(&self, ego: &Pose, pose: &Pose) -> bool {
        let seen = ego.inverse() * pose;
        let (cosine, sine) = (
            seen.rotation.cos_angle().abs(),
            seen.rotation.sin_angle().abs(),
        );
        let length_m = EGO_HALF_M.0 + self.half_m.0 * cosine + self.half_m.1 * sine;
        let width_m = EGO_HALF_M.1 + self.half_m.1 * cosine + self.half_m.0 * sine;
        seen.translation.x.abs() < length_m && seen.translation.y.abs() < width_m
    }
}
