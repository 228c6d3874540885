//! Highlights: the spot of a smooth wall that faces the sensor squarely, and glides along the wall as the sensor drives by.
//!
//! A flat plate that is larger than the first Fresnel zone reflects like its own mirror image: its cross-section is
//! pi R^2 times the mirrored share (Knott, Shaeffer and Tuley, Radar Cross Section), less what its roughness scatters away. What
//! glides along with a vehicle tells it that it stands still.

use std::collections::BTreeSet;
use std::f64::consts::PI;

use nalgebra::{Point2, Vector2};

use super::echoes::{Echo, NEGLIGIBLE_POWER, View};
use super::stations::Station;
use crate::body::Wall;
use crate::world::World;

/// Share of the mirrored power that stays together: walls have windows, joints and courses.
const SMOOTHNESS: f64 = 0.02;

impl View<'_> {
    /// Collects the highlights of all walls that are met first by a ray.
    pub fn highlights(&self, world: &World, echoes: &mut Vec<Echo>) {
        let numbers: BTreeSet<u32> = self
            .skyline
            .first_walls(self.stations.azimuths())
            .map(|first| first.wall)
            .collect();
        for wall in numbers
            .into_iter()
            .filter_map(|number| world.walls().get(number as usize))
        {
            self.highlight(wall, echoes);
        }
    }

    fn highlight(&self, wall: &Wall, echoes: &mut Vec<Echo>) {
        let spot = |station: &Station| foot(station.position, wall);
        self.stations.passings(spot, |azimuth| {
            let station = self.stations.at(azimuth);
            let position = spot(station);
            let range_m = (position - station.position).norm();
            let on_wall = (position - wall.from).dot(&(position - wall.to)) < 0.0;
            if !on_wall || range_m > self.reach_m {
                return;
            }
            let cross_section_m2 = PI * range_m * range_m * wall.mirror * SMOOTHNESS;
            let passed = self.transmission(azimuth, range_m, wall.body);
            let power = cross_section_m2 * passed * self.received(range_m);
            if power > NEGLIGIBLE_POWER {
                echoes.push(Echo {
                    position,
                    velocity: Vector2::zeros(),
                    amplitude: power.sqrt(),
                    azimuth,
                });
            }
        });
    }
}

/// The place on a wall's line that is nearest.
fn foot(from: Point2<f64>, wall: &Wall) -> Point2<f64> {
    let along = wall.to - wall.from;
    let length2 = along.norm_squared();
    if length2 == 0.0 {
        wall.from
    } else {
        wall.from + along * ((from - wall.from).dot(&along) / length2)
    }
}
