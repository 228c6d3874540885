//! Specular highlights: the reflection of a smooth wall at normal incidence, which moves along the
//! wall with the sensor.
//!
//! A flat plate larger than the first Fresnel zone reflects like its own mirror image: its
//! cross-section is pi R^2 times the mirrored share (Knott, Shaeffer and Tuley, Radar Cross
//! Section), less the part that roughness scatters. For odometry a highlight looks like an object
//! at rest relative to the vehicle.

use std::collections::BTreeSet;
use std::f64::consts::PI;

use nalgebra::Point2;

use super::echoes::{Echo, View};
use super::sweep_poses::AzimuthPose;
use crate::body::Wall;
use crate::world::World;

/// Coherent share of the mirrored power: walls have windows, joints and courses.
const SMOOTHNESS: f64 = 0.02;

impl View<'_> {
    /// Adds the highlights of all walls that a ray hits first.
    pub fn highlights(&self, world: &World, echoes: &mut Vec<Echo>) {
        let numbers: BTreeSet<u32> = self
            .line_of_sight
            .first_walls(self.sweep_poses.azimuths())
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
        let spot = |azimuth_pose: &AzimuthPose| foot(azimuth_pose.position, wall);
        self.sweep_poses.beam_passes(spot, |azimuth| {
            let azimuth_pose = self.sweep_poses.at(azimuth);
            let position = spot(azimuth_pose);
            let range_m = (position - azimuth_pose.position).norm();
            let on_wall = (position - wall.from).dot(&(position - wall.to)) < 0.0;
            if !on_wall || range_m > self.reach_m {
                return;
            }
            let cross_section_m2 = PI * range_m * range_m * wall.mirror * SMOOTHNESS;
            let passed = self.transmission(azimuth, range_m, wall.body);
            let power = cross_section_m2 * passed * self.received(range_m);
            echoes.extend(Echo::still(position, power, azimuth));
        });
    }
}

/// The projection of a place onto a wall's line.
fn foot(from: Point2<f64>, wall: &Wall) -> Point2<f64> {
    let along = wall.to - wall.from;
    let length2 = along.norm_squared();
    if length2 == 0.0 {
        wall.from
    } else {
        wall.from + along * ((from - wall.from).dot(&along) / length2)
    }
}
