//! A random drive through a town: turns, stops at junctions, loops that close, streets driven back again.

mod lane;
mod plan;
mod route;
mod speed;
mod steered;

use gyre_geometry::Pose;

use super::spline_path::SplinePath;
use crate::lanes::DrivingSide;
use crate::stream::Stream;

/// Seconds between the poses that the drive is computed at.
const STEP_S: f64 = 0.1;
/// What changes faster than so many times a second is smoothed away: less than any car turns its wheels.
const CUTOFF_HZ: f64 = 1.2;

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
    pub keep: DrivingSide,
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
        let way = steered::steered(&lane);
        let limits = speed::Limits {
            speed_mps: self.speed_mps,
            lateral_mps2: self.lateral_acceleration_mps2,
        };
        let progress = speed::progress(&way, &lane, &limits, self.length_m, &mut rng, STEP_S);
        let pose = |along_m: &f64| {
            let ([x, y], [dx, dy]) = (way.curve.value(*along_m), way.curve.slope(*along_m));
            gyre_geometry::pose(x, y, dy.atan2(dx))
        };
        let start = progress.first().map_or(Pose::identity(), pose).inverse();
        let poses: Vec<_> = progress
            .iter()
            .enumerate()
            .map(|(i, s)| (i as f64 * STEP_S, start * pose(s)))
            .collect();
        SplinePath::new(&poses, CUTOFF_HZ)
    }
}

#[cfg(test)]
mod tests;
