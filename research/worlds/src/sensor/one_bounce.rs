//! Paths with one bounce: sensor, object, smooth wall, sensor, and the same way back to front.
//!
//! The beam has to reach both the object and its mirror image, so they count for objects close
//! before a wall, seen along it: then an echo appears half-way between the object and its image
//! (the first type of Kamann et al. 2018, Automotive Radar Multipath Propagation in Uncertain
//! Environments).

use nalgebra::Point2;

use super::antenna::Antenna;
use super::echoes::{Echo, View};
use super::ghosts::{before_mirrors, image};
use super::sweep_poses::AzimuthPose;
use crate::body::{Scatterer, Wall};
use crate::occlusion::crossing;
use crate::world::World;

/// Power of two paths of equal length, there and back, which add in amplitude.
const BOTH_WAYS: f64 = 4.0;

impl View<'_> {
    /// Adds the echoes with one bounce off the largest mirrors.
    pub fn one_bounce(&self, world: &World, antenna: &Antenna, echoes: &mut Vec<Echo>) {
        let azimuths = self.sweep_poses.azimuths();
        for (wall, scatterer) in before_mirrors(world, self.line_of_sight, azimuths) {
            self.bounce(&wall, scatterer, antenna, echoes);
        }
    }

    fn bounce(&self, wall: &Wall, of: &Scatterer, antenna: &Antenna, echoes: &mut Vec<Echo>) {
        let mirrored = image(of.position, wall);
        let middle = |from: &AzimuthPose| between(from.position, of.position, mirrored);
        self.sweep_poses.beam_passes(middle, |azimuth| {
            let from = self.sweep_poses.at(azimuth);
            let (direct, image) = (of.position - from.position, mirrored - from.position);
            if crossing(from.position, image, wall).is_none() {
                return;
            }
            let position = middle(from);
            let range_m = (position - from.position).norm();
            let apart_rad = direct.perp(&image).atan2(direct.dot(&image));
            // One way at the object and one at the image: for a Gaussian beam the gain of both ways
            // at half their distance.
            let gain = antenna.gain(apart_rad / 2.0).powi(2);
            let cross_section_m2 = self.cross_section_m2(of, -direct.normalize());
            let passed = self.transmission(azimuth, direct.norm(), of.body);
            let power = BOTH_WAYS
                * gain
                * wall.mirror
                * passed
                * cross_section_m2
                * self.received(range_m)
                * self.elevation_gain(of, range_m, from);
            if range_m < self.reach_m {
                echoes.extend(Echo::still(position, power, azimuth));
            }
        });
    }
}

/// The place in the middle direction of two others at their mean range.
fn between(from: Point2<f64>, one: Point2<f64>, other: Point2<f64>) -> Point2<f64> {
    let (one, other) = (one - from, other - from);
    let direction = one.normalize() + other.normalize();
    from + direction.normalize() * ((one.norm() + other.norm()) / 2.0)
}
