//! The motion of road users as functions of time.

use std::f64::consts::{PI, TAU};

use gyre_geometry::Pose;

use super::ego_route::EgoRoute;
use crate::lanes::LANE_M;
use crate::path::spline::UniformSpline;

/// Delay of a vehicle's motion behind that of the one ahead, seconds (Newell, "A simplified
/// car-following theory", 2002).
pub const REACTION_S: f64 = 1.2;

/// The place of a road user at any time.
#[derive(Clone, Debug)]
pub enum Track {
    /// In the ego lane, ahead or behind: the gaps to all vehicles between, nearest first.
    Lane { ahead: bool, gaps: Vec<Gap> },
    /// In the oncoming lane.
    Oncoming(Oncoming),
    /// Along the route, beside the ego vehicle's track.
    Alongside(Alongside),
    /// Out of a side street.
    Crossing(Crossing),
}

/// A gap between two vehicles in a lane, by the place of the nearer one.
#[derive(Clone, Debug)]
pub struct Gap {
    /// Minimum distance between their centres, metres.
    pub min_m: f64,
    /// Maximum increase, metres,
    pub extra_m: f64,
    /// with this period along the route, metres,
    pub period_m: f64,
    /// and this phase, radians.
    pub phase: f64,
}

/// A vehicle in the oncoming lane.
#[derive(Clone, Debug)]
pub struct Oncoming {
    /// The time at which it enters the route at its end, seconds.
    pub enters_s: f64,
    /// Maximum time that it is early or late, seconds,
    pub drift_s: f64,
    /// with this period along the route, metres,
    pub period_m: f64,
    /// and this phase, radians.
    pub phase: f64,
}

/// A road user that moves along the route.
#[derive(Clone, Debug)]
pub struct Alongside {
    /// The place where the ego vehicle meets it, metres along the route,
    pub at_m: f64,
    /// and the time, seconds.
    pub at_s: f64,
    /// The speed relative to the ego vehicle's: above 1 it overtakes, below it is overtaken.
    pub share: f64,
    /// The additional speed along the route, metres a second.
    pub speed_mps: f64,
    pub lane: Lane,
}

/// The lateral position of a road user.
#[derive(Clone, Copy, Debug)]
pub enum Lane {
    /// Distance from the ego vehicle's track towards the centre of the street, metres.
    Inwards(f64),
    /// Distance beyond the kerb on the ego vehicle's side, metres; at least [`PASSING_M`] from its
    /// track.
    EgoKerb(f64),
    /// Distance beyond the other kerb, metres.
    OtherKerb(f64),
}

/// Distance between the tracks of the ego vehicle and a cyclist, metres.
pub const PASSING_M: f64 = 1.7;

/// A vehicle that comes out of a side street, waits, and may cross.
#[derive(Clone, Debug)]
pub struct Crossing {
    /// The path by distance.
    pub path: UniformSpline<2>,
    /// The place on the path where it waits, metres.
    pub waits_m: f64,
    /// The start of the wait, seconds.
    pub from_s: f64,
    /// The end of the wait, seconds; infinite if it does not cross.
    pub until_s: f64,
    /// Speed before and after the wait, metres a second.
    pub speed_mps: f64,
    /// Length of the path, metres; beyond its ends the vehicle is gone.
    pub length_m: f64,
}

impl Track {
    /// The pose at a time; `None` if it is not on the road.
    pub fn pose(&self, route: &EgoRoute, time_s: f64) -> Option<Pose> {
        if let Self::Crossing(crossing) = self {
            return crossing.pose(time_s);
        }
        let along_m = self.along_m(route, time_s);
        if (along_m - route.progress_m(time_s)).abs() > route.reach_m() {
            return None;
        }
        let inwards_m = match self {
            Self::Lane { .. } | Self::Crossing(_) => 0.0,
            Self::Oncoming(_) => other_lane_m(route.kerbs_m(along_m)),
            Self::Alongside(alongside) => alongside.inwards_m(route.kerbs_m(along_m)),
        };
        let pose = route.pose(along_m, inwards_m);
        let turned = matches!(self, Self::Oncoming(_))
            || matches!(self, Self::Alongside(b) if b.share == 0.0 && b.speed_mps < 0.0);
        Some(if turned {
            pose * Pose::rotation(PI)
        } else {
            pose
        })
    }

    /// Distance along the route at a time, metres; zero for road users that are not on it.
    pub fn along_m(&self, route: &EgoRoute, time_s: f64) -> f64 {
        match self {
            Self::Lane { ahead, gaps } => {
                let sign = if *ahead { 1.0 } else { -1.0 };
                let ego_m = route.progress_m(time_s + sign * REACTION_S * gaps.len() as f64);
                gaps.iter()
                    .fold(ego_m, |place_m, gap| place_m + sign * gap.at(place_m))
            }
            Self::Oncoming(vehicle) => vehicle.along_m(route, time_s),
            Self::Alongside(b) => {
                b.at_m
                    + b.share * (route.progress_m(time_s) - b.at_m)
                    + b.speed_mps * (time_s - b.at_s)
            }
            Self::Crossing(_) => 0.0,
        }
    }
}

/// Distance from the ego vehicle's track to the oncoming lane, metres: in the middle of the other
/// half of the carriageway.
fn other_lane_m([ego_m, other_m]: [f64; 2]) -> f64 {
    (0.75 * other_m - 0.25 * ego_m).max(LANE_M)
}

impl Gap {
    fn at(&self, place_m: f64) -> f64 {
        self.min_m + self.extra_m * 0.5 * (1.0 - (TAU * place_m / self.period_m + self.phase).cos())
    }
}

impl Oncoming {
    fn along_m(&self, route: &EgoRoute, time_s: f64) -> f64 {
        let until_start_s = route.clock_s(f64::INFINITY) - (time_s - self.enters_s);
        let on_time_m = route.place_m(until_start_s);
        let drift_s = self.drift_s * (TAU * on_time_m / self.period_m + self.phase).sin();
        route.place_m(until_start_s + drift_s)
    }
}

impl Alongside {
    fn inwards_m(&self, [ego_m, other_m]: [f64; 2]) -> f64 {
        match self.lane {
            Lane::Inwards(inwards_m) => inwards_m,
            Lane::EgoKerb(beyond_m) => -(ego_m + beyond_m).max(PASSING_M),
            Lane::OtherKerb(beyond_m) => other_m + beyond_m,
        }
    }
}

impl Crossing {
    fn pose(&self, time_s: f64) -> Option<Pose> {
        let at_m =
            self.waits_m - self.ramp_m(self.from_s - time_s) + self.ramp_m(time_s - self.until_s);
        if !(0.0..=self.length_m).contains(&at_m) {
            return None;
        }
        let ([x, y], [dx, dy]) = (self.path.value(at_m), self.path.slope(at_m));
        Some(gyre_geometry::pose(x, y, dy.atan2(dx)))
    }

    /// Distance driven in a time after starting, metres: initially at 2 m/s², then less and less.
    fn ramp_m(&self, seconds: f64) -> f64 {
        if seconds <= 0.0 {
            0.0
        } else {
            self.speed_mps * seconds * seconds / (seconds + self.speed_mps)
        }
    }
}
