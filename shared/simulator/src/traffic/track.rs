//! How road users move: functions of time alone.

use std::f64::consts::{PI, TAU};

use gyre_geometry::Pose;

use super::own_way::OwnWay;
use crate::lanes::LANE_M;
use crate::path::spline::UniformSpline;

/// Seconds that a vehicle's motion lags that of the one ahead (Newell, "A simplified car-following theory", 2002).
pub const REACTION_S: f64 = 1.2;

/// Where a road user is at any time.
#[derive(Clone, Debug)]
pub enum Track {
    /// In the vehicle's lane, ahead of it or behind: the gaps to all vehicles between, nearest first.
    Lane { ahead: bool, gaps: Vec<Gap> },
    /// Towards the vehicle in the other lane.
    Oncoming(Oncoming),
    /// Along the way, beside the vehicle's track.
    Beside(Beside),
    /// Out of a side street.
    Crossing(Crossing),
}

/// A gap between two vehicles in a lane, which depends on where the nearer one is.
#[derive(Clone, Debug)]
pub struct Gap {
    /// From middle to middle when standing, metres.
    pub least_m: f64,
    /// How much it grows at most, metres,
    pub more_m: f64,
    /// with this period along the way, metres,
    pub period_m: f64,
    /// and this phase, radians.
    pub phase: f64,
}

/// A vehicle in the other lane.
#[derive(Clone, Debug)]
pub struct Oncoming {
    /// When it enters the way at its end, seconds.
    pub enters_s: f64,
    /// It runs early or late by this, seconds,
    pub drift_s: f64,
    /// in turns of this length of the way, metres,
    pub period_m: f64,
    /// with this phase, radians.
    pub phase: f64,
}

/// Somebody who goes along the way.
#[derive(Clone, Debug)]
pub struct Beside {
    /// Where the vehicle meets them, metres along the way,
    pub at_m: f64,
    /// and when, seconds.
    pub at_s: f64,
    /// Metres along the way for each metre of the vehicle: above 1 overtakes it, below is overtaken.
    pub share: f64,
    /// Metres a second along the way besides.
    pub speed_mps: f64,
    pub lane: Lane,
}

/// Where across the street somebody goes.
#[derive(Clone, Copy, Debug)]
pub enum Lane {
    /// So far from the vehicle's track towards the middle of the street, metres.
    Inwards(f64),
    /// So far beyond the kerb of the vehicle's side, metres, and never nearer to its track than [`PASSING_M`].
    OwnKerb(f64),
    /// So far beyond the other kerb, metres.
    OtherKerb(f64),
}

/// Room between the tracks of the vehicle and of a cyclist, metres.
pub const PASSING_M: f64 = 1.7;

/// A vehicle that comes out of a side street, waits, and may cross.
#[derive(Clone, Debug)]
pub struct Crossing {
    /// Its path by length.
    pub path: UniformSpline<2>,
    /// Where on the path it waits, metres.
    pub waits_m: f64,
    /// Since when, seconds,
    pub from_s: f64,
    /// until when, seconds; for ever where it is infinite.
    pub until_s: f64,
    /// Speed that it brakes from and speeds up to, metres a second.
    pub speed_mps: f64,
    /// Length of the path, metres: it is gone beyond its ends.
    pub length_m: f64,
}

impl Track {
    /// The pose at a time; `None` where it is not on the road.
    pub fn pose(&self, way: &OwnWay, time_s: f64) -> Option<Pose> {
        if let Self::Crossing(crossing) = self {
            return crossing.pose(time_s);
        }
        let along_m = self.along_m(way, time_s);
        if (along_m - way.progress_m(time_s)).abs() > way.reach_m() {
            return None;
        }
        let inwards_m = match self {
            Self::Lane { .. } | Self::Crossing(_) => 0.0,
            Self::Oncoming(_) => other_lane_m(way.kerbs_m(along_m)),
            Self::Beside(beside) => beside.inwards_m(way.kerbs_m(along_m)),
        };
        let pose = way.pose(along_m, inwards_m);
        let turned = matches!(self, Self::Oncoming(_))
            || matches!(self, Self::Beside(b) if b.share == 0.0 && b.speed_mps < 0.0);
        Some(if turned {
            pose * Pose::rotation(PI)
        } else {
            pose
        })
    }

    /// Metres along the way at a time; zero for what is not on it.
    pub fn along_m(&self, way: &OwnWay, time_s: f64) -> f64 {
        match self {
            Self::Lane { ahead, gaps } => {
                let sign = if *ahead { 1.0 } else { -1.0 };
                let own_m = way.progress_m(time_s + sign * REACTION_S * gaps.len() as f64);
                gaps.iter()
                    .fold(own_m, |place_m, gap| place_m + sign * gap.at(place_m))
            }
            Self::Oncoming(vehicle) => vehicle.along_m(way, time_s),
            Self::Beside(b) => {
                b.at_m
                    + b.share * (way.progress_m(time_s) - b.at_m)
                    + b.speed_mps * (time_s - b.at_s)
            }
            Self::Crossing(_) => 0.0,
        }
    }
}

/// From the vehicle's track to that of oncoming traffic, metres: in the middle of the other half of the carriageway.
fn other_lane_m([own_m, other_m]: [f64; 2]) -> f64 {
    (0.75 * other_m - 0.25 * own_m).max(LANE_M)
}

impl Gap {
    fn at(&self, place_m: f64) -> f64 {
        self.least_m
            + self.more_m * 0.5 * (1.0 - (TAU * place_m / self.period_m + self.phase).cos())
    }
}

impl Oncoming {
    fn along_m(&self, way: &OwnWay, time_s: f64) -> f64 {
        let until_start_s = way.clock_s(f64::INFINITY) - (time_s - self.enters_s);
        let on_time_m = way.place_m(until_start_s);
        let drift_s = self.drift_s * (TAU * on_time_m / self.period_m + self.phase).sin();
        way.place_m(until_start_s + drift_s)
    }
}

impl Beside {
    fn inwards_m(&self, [own_m, other_m]: [f64; 2]) -> f64 {
        match self.lane {
            Lane::Inwards(inwards_m) => inwards_m,
            Lane::OwnKerb(beyond_m) => -(own_m + beyond_m).max(PASSING_M),
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

    /// Metres driven some seconds after starting: first at 2 m/s², and less and less.
    fn ramp_m(&self, seconds: f64) -> f64 {
        if seconds <= 0.0 {
            0.0
        } else {
            self.speed_mps * seconds * seconds / (seconds + self.speed_mps)
        }
    }
}
