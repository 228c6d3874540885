//! Ghost targets: mirror images by a double bounce off a smooth front (sensor, wall, object, wall,
//! sensor).
//!
//! A mirror image behaves like an object behind the wall, visible where the line of sight to it
//! crosses the wall.

use std::collections::BTreeMap;

use nalgebra::{Point2, Vector2};

use super::echoes::{Echo, NEGLIGIBLE_POWER, View};
use super::line_of_sight::LineOfSight;
use super::sweep_poses::AzimuthPose;
use crate::body::{Scatterer, Wall};
use crate::occlusion::crossing;
use crate::world::World;

/// Minimum mirrored share of walls that are considered.
const MIN_MIRROR: f64 = 0.15;
/// Maximum number of mirrors in a sweep: those that cover most of the view.
const MAX_MIRRORS: usize = 12;
/// Minimum cross-section of objects with a visible image, square metres.
const MIN_CROSS_SECTION_M2: f64 = 3.0;
/// Maximum distance of objects from a mirror, metres.
const REACH_M: f64 = 50.0;

impl View<'_> {
    /// Adds the images of strong reflectors in the largest mirrors.
    pub fn ghosts(&self, world: &World, echoes: &mut Vec<Echo>) {
        let azimuths = self.sweep_poses.azimuths();
        for (wall, scatterer) in before_mirrors(world, self.line_of_sight, azimuths) {
            self.ghost(world, &wall, scatterer, echoes);
        }
    }

    fn ghost(&self, world: &World, wall: &Wall, of: &Scatterer, echoes: &mut Vec<Echo>) {
        let position = image(of.position, wall);
        self.sweep_poses.beam_passes(
            |_: &AzimuthPose| position,
            |azimuth| {
                let azimuth_pose = self.sweep_poses.at(azimuth);
                let ray = position - azimuth_pose.position;
                let Some(share) = crossing(azimuth_pose.position, ray, wall) else {
                    return;
                };
                let range_m = ray.norm();
                let bounce = azimuth_pose.position + ray * share;
                let cross_section_m2 =
                    self.cross_section_m2(of, (bounce - of.position).normalize());
                let mirrored = cross_section_m2
                    * wall.mirror
                    * wall.mirror
                    * self.elevation_gain(of, range_m, azimuth_pose);
                let bright = mirrored * self.received(range_m);
                let negligible = NEGLIGIBLE_POWER / bright;
                if range_m > self.reach_m || negligible >= 1.0 {
                    return;
                }
                let out = self.transmission(azimuth, share * range_m, wall.body);
                let on = || world.transmission(bounce, of.position, wall.body, negligible);
                let passed = if self.effects.occlusion {
                    out * on()
                } else {
                    out
                };
                if passed > negligible {
                    let amplitude = (bright * passed).sqrt();
                    echoes.push(Echo {
                        position,
                        velocity: Vector2::zeros(),
                        amplitude,
                        azimuth,
                        height_m: 0.0,
                    });
                }
            },
        );
    }
}

/// The strong reflectors before the largest mirrors, each with its mirror.
pub(super) fn before_mirrors<'w>(
    world: &'w World,
    line_of_sight: &LineOfSight,
    azimuths: usize,
) -> impl Iterator<Item = (Wall, &'w Scatterer)> {
    mirrors(world, line_of_sight, azimuths)
        .into_iter()
        .flat_map(move |wall| {
            let middle = Point2::from((wall.from.coords + wall.to.coords) / 2.0);
            let strong = move |s: &&Scatterer| {
                s.cross_section_m2 >= MIN_CROSS_SECTION_M2
                    && s.body != wall.body
                    && (s.position - middle).norm() < REACH_M
            };
            let around = world.around(middle, REACH_M).flatten().filter(strong);
            around.map(move |scatterer| (wall, scatterer))
        })
}

/// The mirrors that cover most of the view, by the number of rays that hit them first.
fn mirrors(world: &World, line_of_sight: &LineOfSight, azimuths: usize) -> Vec<Wall> {
    let mut rays: BTreeMap<u32, u32> = BTreeMap::new();
    for first in line_of_sight.first_walls(azimuths) {
        if world
            .walls()
            .get(first.wall as usize)
            .is_some_and(|wall| wall.mirror >= MIN_MIRROR)
        {
            *rays.entry(first.wall).or_default() += 1;
        }
    }
    let mut largest: Vec<(u32, u32)> = rays.into_iter().map(|(wall, rays)| (rays, wall)).collect();
    largest.sort_unstable_by(|a, b| b.0.cmp(&a.0).then(a.1.cmp(&b.1)));
    largest
        .into_iter()
        .take(MAX_MIRRORS)
        .map(|(_, wall)| world.walls()[wall as usize])
        .collect()
}

/// The mirror image of a place behind the wall.
pub(super) fn image(of: Point2<f64>, wall: &Wall) -> Point2<f64> {
    let along = (wall.to - wall.from).normalize();
    let across = Vector2::new(-along.y, along.x);
    of - across * (2.0 * (of - wall.from).dot(&across))
}
