//! What hides what: rays from the sensor, one bundle an azimuth, each with the walls that it passes.

use nalgebra::{Rotation2, Vector2};

use super::stations::{MARGIN, Station, Stations};
use crate::body::{Moving, NO_BODY, Wall};
use crate::occlusion::crossing;
use crate::world::World;

/// Rays for each azimuth of 0.9 degrees.
const RAYS: usize = 4;
/// Metres by which a wall must be nearer than what it hides: things lean against walls.
const LEANING_M: f32 = 0.1;

/// No part of a mover is farther than this from its origin, metres: half a long bus.
const MOVER_M: f64 = 10.0;

/// A wall on a ray's way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Passed {
    pub range_m: f32,
    pub transmission: f32,
    pub body: u32,
    /// Number of the wall in the world, for those that stand; `u32::MAX` for those that move.
    pub wall: u32,
}

/// All rays of a sweep, each from where the sensor is when it looks there.
#[derive(Clone, Debug, Default)]
pub(super) struct Skyline {
    passed: Vec<Passed>,
    /// `starts[r]..starts[r + 1]` are the walls of ray `r`, nearest first.
    starts: Vec<usize>,
}

impl Skyline {
    /// Casts all rays of a sweep.
    pub fn cast(
        &mut self,
        world: &World,
        moving: &[Moving<'_>],
        stations: &Stations,
        reach_m: f64,
    ) {
        self.passed.clear();
        self.starts.clear();
        for ray in 0..(stations.azimuths() + 2 * MARGIN) * RAYS {
            let first = self.passed.len();
            self.starts.push(first);
            let azimuth = ray as f64 / RAYS as f64 - MARGIN as f64;
            let station = stations.at(azimuth.floor());
            let turned = azimuth.fract().rem_euclid(1.0) * stations.step_rad();
            let way = Rotation2::new(-turned) * station.beam * reach_m;
            self.cast_ray(world, moving, station, way, reach_m);
            self.passed[first..].sort_unstable_by(|a, b| a.range_m.total_cmp(&b.range_m));
        }
        self.starts.push(self.passed.len());
    }

    fn cast_ray(
        &mut self,
        world: &World,
        moving: &[Moving<'_>],
        station: &Station,
        way: Vector2<f64>,
        reach_m: f64,
    ) {
        let passed = &mut self.passed;
        let mut add = |number: u32, wall: &Wall, share: f64| {
            let range_m = (share * reach_m) as f32;
            passed.push(Passed {
                range_m,
                transmission: wall.transmission as f32,
                body: wall.body,
                wall: number,
            });
        };
        world.walls_between(station.position, station.position + way, &mut add);
        for mover in moving {
            let pose = mover.pose_after(station.time_s);
            let from = pose.inverse_transform_point(&station.position);
            let way = pose.inverse_transform_vector(&way);
            // Only what passes the circle around a body can cross a wall of it.
            let (aside, ahead) = (way.perp(&from.coords).abs(), -way.dot(&from.coords));
            if aside > MOVER_M * reach_m || ahead < -MOVER_M * reach_m {
                continue;
            }
            for wall in &mover.body.walls {
                if let Some(share) = crossing(from, way, wall) {
                    add(u32::MAX, wall, share);
                }
            }
        }
    }

    /// Share of the power, there and back, that passes to a thing of `body` at `range_m` and an azimuth with fractions.
    pub fn transmission(&self, azimuth: f64, range_m: f64, body: u32) -> f32 {
        let nearer = range_m as f32 - LEANING_M;
        self.ray(azimuth)
            .iter()
            .take_while(|wall| wall.range_m < nearer)
            .filter(|wall| body == NO_BODY || wall.body != body)
            .map(|wall| wall.transmission)
            .product()
    }

    /// Share of the power, there and back, that passes to a range along the middle of an azimuth's beam.
    pub fn open(&self, azimuth: usize, range_m: f64) -> f32 {
        self.transmission(azimuth as f64, range_m, NO_BODY)
    }

    /// The walls on the ray nearest to an azimuth, nearest first.
    pub fn ray(&self, azimuth: f64) -> &[Passed] {
        // What is below zero becomes zero.
        let ray = ((azimuth + MARGIN as f64) * RAYS as f64 + 0.5) as usize;
        let ray = ray.min(self.starts.len() - 2);
        &self.passed[self.starts[ray]..self.starts[ray + 1]]
    }

    /// The first walls of all rays of the sweep proper.
    pub fn first_walls(&self, azimuths: usize) -> impl Iterator<Item = &Passed> {
        let rays = MARGIN * RAYS..(azimuths + MARGIN) * RAYS;
        rays.filter_map(|ray| self.passed[self.starts[ray]..self.starts[ray + 1]].first())
    }
}
