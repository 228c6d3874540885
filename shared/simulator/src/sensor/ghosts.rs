//! Mirror images: what is seen twice bounced off a smooth front (sensor, wall, thing, wall, sensor).
//!
//! The image of a thing behind a mirror is seen exactly like a thing that stands there, wherever the way to it goes through the
//! mirror. Ways that bounce once only come back from another direction than they were sent to, and a narrow beam does not
//! hear them.

use std::collections::BTreeMap;

use nalgebra::{Point2, Vector2};

use super::echoes::{Echo, NEGLIGIBLE_POWER, View};
use super::skyline::Skyline;
use super::stations::Station;
use crate::body::{Scatterer, Wall};
use crate::occlusion::crossing;
use crate::world::World;

/// Walls that mirror less than this share of the power show nothing.
const LEAST_MIRROR: f64 = 0.15;
/// Most mirrors of a sweep: those that fill most of the view.
const MOST_MIRRORS: usize = 12;
/// Things that reflect less than this, square metres, have no visible image.
const LEAST_CROSS_SECTION_M2: f64 = 3.0;
/// How far from a mirror a thing may be, metres.
const REACH_M: f64 = 50.0;

impl View<'_> {
    /// Collects the images of strong reflectors in the largest mirrors.
    pub fn ghosts(&self, world: &World, echoes: &mut Vec<Echo>) {
        for wall in mirrors(world, self.skyline, self.stations.azimuths()) {
            let middle = Point2::from((wall.from.coords + wall.to.coords) / 2.0);
            let strong = |s: &&Scatterer| {
                s.cross_section_m2 >= LEAST_CROSS_SECTION_M2
                    && s.body != wall.body
                    && (s.position - middle).norm() < REACH_M
            };
            for scatterer in world.around(middle, REACH_M).flatten().filter(strong) {
                self.ghost(world, &wall, scatterer, echoes);
            }
        }
    }

    fn ghost(&self, world: &World, wall: &Wall, of: &Scatterer, echoes: &mut Vec<Echo>) {
        let position = image(of.position, wall);
        self.stations.passings(
            |_: &Station| position,
            |azimuth| {
                let station = self.stations.at(azimuth);
                let way = position - station.position;
                let Some(share) = crossing(station.position, way, wall) else {
                    return;
                };
                let range_m = way.norm();
                let bounce = station.position + way * share;
                let cross_section_m2 =
                    self.cross_section_m2(of, (bounce - of.position).normalize());
                let mirrored =
                    cross_section_m2 * wall.mirror * wall.mirror * self.lit(of, range_m, station);
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
                    });
                }
            },
        );
    }
}

/// The mirrors that fill most of the view, by the number of rays that meet them first.
fn mirrors(world: &World, skyline: &Skyline, azimuths: usize) -> Vec<Wall> {
    let mut rays: BTreeMap<u32, u32> = BTreeMap::new();
    for first in skyline.first_walls(azimuths) {
        if world
            .walls()
            .get(first.wall as usize)
            .is_some_and(|wall| wall.mirror >= LEAST_MIRROR)
        {
            *rays.entry(first.wall).or_default() += 1;
        }
    }
    let mut largest: Vec<(u32, u32)> = rays.into_iter().map(|(wall, rays)| (rays, wall)).collect();
    largest.sort_unstable_by(|a, b| b.0.cmp(&a.0).then(a.1.cmp(&b.1)));
    largest
        .into_iter()
        .take(MOST_MIRRORS)
        .map(|(_, wall)| world.walls()[wall as usize])
        .collect()
}

/// Where a mirrored thing is seen: its image behind the wall.
fn image(of: Point2<f64>, wall: &Wall) -> Point2<f64> {
    let along = (wall.to - wall.from).normalize();
    let across = Vector2::new(-along.y, along.x);
    of - across * (2.0 * (of - wall.from).dot(&across))
}
