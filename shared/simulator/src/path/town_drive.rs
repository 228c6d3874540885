//! A random drive through a town: turns, stops at junctions, loops that close, streets driven back again.

mod lane;
mod plan;
mod route;
mod speed;

use nalgebra::{Isometry2, Point2};

use super::SplinePath;
use super::spline::{Sample, UniformSpline};
use crate::stream::Stream;
use crate::streets::Keep;

/// Seconds between the poses that the drive is computed at.
const STEP_S: f64 = 0.1;
/// What changes faster than so many times a second is smoothed away: less than any car turns its wheels.
const CUTOFF_HZ: f64 = 1.2;
/// The wheels are turned over so many metres: shorter wiggles of the lane are smoothed away.
const STEER_M: f64 = 9.0;

/// What to drive through a town.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TownDrive {
    /// Length of the drive, metres.
    pub length_m: f64,
    /// Speed limit on the fastest streets, metres a second; it is lower on others.
    pub speed_mps: f64,
    /// Sideways acceleration at which bends are taken, metres a second squared.
    pub lateral_acceleration_mps2: f64,
    /// The side that traffic keeps to.
    pub keep: Keep,
}

impl TownDrive {
    /// The drive, the same for the same seed.
    ///
    /// It comes back to its first streets and takes them once more, has driven some streets in both directions by then,
    /// and ends standing. Streets cross at junctions only; parallel ones are 50 m apart or more. Its start is the origin.
    pub fn path(&self, seed: u64) -> SplinePath {
        let mut rng = Stream::Drive.generator(seed);
        let town = plan::Plan::new(self.length_m, &mut rng);
        let route = route::route(&town, self.length_m, &mut rng);
        let lane = lane::lane(&town, &route, self.keep);
        let way = steered(&lane);
        let limits = speed::Limits {
            speed_mps: self.speed_mps,
            lateral_mps2: self.lateral_acceleration_mps2,
        };
        let progress = speed::progress(&way, &lane, &limits, self.length_m, &mut rng, STEP_S);
        let pose = |along_m: &f64| {
            let ([x, y], [dx, dy]) = (way.curve.value(*along_m), way.curve.slope(*along_m));
            Isometry2::new(nalgebra::Vector2::new(x, y), dy.atan2(dx))
        };
        let start = progress
            .first()
            .map_or(Isometry2::identity(), pose)
            .inverse();
        let poses: Vec<_> = progress
            .iter()
            .enumerate()
            .map(|(i, s)| (i as f64 * STEP_S, start * pose(s)))
            .collect();
        SplinePath::new(&poses, CUTOFF_HZ)
    }
}

/// A lane as it is driven.
struct Way {
    /// The vehicle by metres along the lane.
    curve: UniformSpline<2>,
    length_m: f64,
}

/// Drives a lane with wheels that turn gradually.
fn steered(lane: &lane::Lane) -> Way {
    let mut length_m = 0.0;
    let mut before: Option<Point2<f64>> = None;
    let sample = |place: &Point2<f64>| {
        length_m += before.map_or(0.0, |before| (place - before).norm());
        before = Some(*place);
        Sample {
            at: length_m,
            value: [place.x, place.y],
            weight: 1.0,
        }
    };
    let samples: Vec<_> = lane.places.iter().map(sample).collect();
    Way {
        curve: UniformSpline::fit(&samples, 1.0, 1.0 / STEER_M),
        length_m,
    }
}

#[cfg(test)]
mod tests;
