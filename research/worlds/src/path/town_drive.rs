//! A random drive through a town: turns, stops at junctions, loop closures, streets driven in both
//! directions.

mod lane;
mod plan;
mod route;
mod speed;
mod steered;

use gyre_geometry::Pose;

use super::SplinePath;
use crate::lanes::DrivingSide;
use crate::stream::Stream;

/// Time between the computed poses, seconds.
const STEP_S: f64 = 0.1;
/// Cut-off frequency of the smoothing, Hz: vehicles steer more slowly.
const CUTOFF_HZ: f64 = 1.2;

/// A drive through a town.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TownDrive {
    /// Length of the drive, metres.
    pub length_m: f64,
    /// Speed limit on the fastest streets, metres a second; it is lower on others.
    pub speed_mps: f64,
    /// Lateral acceleration in bends, metres a second squared.
    pub lateral_acceleration_mps2: f64,
    /// The side of the road on which vehicles drive.
    pub driving_side: DrivingSide,
}

impl TownDrive {
    /// Builds the path, the same for the same seed.
    ///
    /// It returns to its first streets and drives them again, drives some streets in both
    /// directions, and ends standing. Streets cross at junctions only; parallel ones are at least
    /// 50 m apart. It starts at the origin.
    pub fn path(&self, seed: u64) -> SplinePath {
        let mut rng = Stream::Drive.generator(seed);
        let town = plan::Plan::new(self.length_m, &mut rng);
        let route = route::route(&town, self.length_m, &mut rng);
        let lane = lane::lane(&town, &route, self.driving_side);
        let steered = steered::steered(&lane);
        let limits = speed::Limits {
            speed_mps: self.speed_mps,
            lateral_mps2: self.lateral_acceleration_mps2,
        };
        let progress = speed::progress(&steered, &lane, &limits, self.length_m, &mut rng, STEP_S);
        let pose = |along_m: &f64| {
            let ([x, y], [dx, dy]) = (steered.curve.value(*along_m), steered.curve.slope(*along_m));
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
