//! The road users at an instant, for ground truth.

use gyre_geometry::Pose;
use nalgebra::{Point2, Vector2};

use super::actors::FIRST_BODY;
use super::kind::Kind;
use super::{Traffic, actor::Actor};
use crate::body::{Moving, NO_BODY, Scatterer, Wall};
use crate::occlusion::crossing;
use crate::profile::Receiver;
use crate::town::ParkedCar;
use crate::world::World;

/// A road user at an instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoadUser {
    /// Number in the drive, from 0.
    pub object: u32,
    /// `car`, `van`, `lorry`, `bus`, `cyclist` or `pedestrian`.
    pub kind: &'static str,
    /// The pose of the centre in the world, x ahead.
    pub pose: Pose,
    /// Velocity in the world, m/s.
    pub velocity: Vector2<f64>,
    /// Length and width, m.
    pub size_m: [f64; 2],
    /// Two-way share of the power that buildings and other road users let pass to the part of it
    /// that is seen best: 0 (hidden) to 1 (in the open).
    pub visible: f64,
    /// The strongest echo as a scan shows it, counts of half a decibel, in clear weather and
    /// without scintillation, speckle and the height of the beam.
    pub counts: f64,
}

/// A sensor that sees road users.
pub struct Observer<'a> {
    /// The standing world.
    pub world: &'a World,
    /// The place of the sensor.
    pub place: Point2<f64>,
    /// The receiver.
    pub receiver: &'a Receiver,
}

impl Traffic {
    /// Returns the road users around an observer at a time of the drive, in the order of their
    /// numbers.
    pub fn road_users(&self, time_s: f64, reach_m: f64, observer: &Observer<'_>) -> Vec<RoadUser> {
        let mut there: Vec<(&Actor, Moving<'_>)> = Vec::new();
        self.visit_actors(time_s, observer.place, reach_m, &mut |actor, moving| {
            there.push((actor, moving));
        });
        let user = |(actor, moving): &(&Actor, Moving<'_>)| {
            let (visible, power) = observer.best_echo(moving, there.iter().map(|other| &other.1));
            let (length, width) = actor.half_m;
            RoadUser {
                object: number(moving) - FIRST_BODY,
                kind: actor.kind.name(),
                pose: moving.pose,
                velocity: moving.velocity,
                size_m: [2.0 * length, 2.0 * width],
                visible,
                counts: counts(power),
            }
        };
        there.iter().map(user).collect()
    }
}

/// Power in the receiver's units as a scan shows it, counts.
fn counts(power: f64) -> f64 {
    20.0 * power.max(1.0).log10()
}

/// The number of a body.
fn number(moving: &Moving<'_>) -> u32 {
    moving
        .body
        .scatterers
        .first()
        .map_or(FIRST_BODY, |scatterer| scatterer.body)
}

impl Observer<'_> {
    /// Returns the largest share of the power that passes to a scatterer of a body, and the power
    /// of its strongest echo, in the receiver's units.
    fn best_echo<'a>(
        &self,
        moving: &Moving<'_>,
        all: impl Iterator<Item = &'a Moving<'a>> + Clone,
    ) -> (f64, f64) {
        let own = number(moving);
        let (mut visible, mut strongest) = (0.0f64, 0.0f64);
        for scatterer in &moving.body.scatterers {
            let there = scatterer.moved(&moving.pose);
            let [walls, power] = self.echo(&there, own);
            let others = all.clone().filter(|other| number(other) != own);
            let passed = others.fold(walls, |passed, other| {
                passed * self.passed(other, &there.position)
            });
            visible = visible.max(passed);
            strongest = strongest.max(power * passed);
        }
        (visible, strongest)
    }

    /// Returns the strongest echo of a parked car as a scan shows it, counts. If it is here, its
    /// own walls do not hide it.
    pub fn parked_counts(&self, car: &ParkedCar, is_here: bool) -> f64 {
        let own = if is_here { car.number } else { NO_BODY };
        let echo = |scatterer: &Scatterer| {
            let [passed, power] = self.echo(&scatterer.moved(&car.pose), own);
            passed * power
        };
        counts(car.body.scatterers.iter().map(echo).fold(0.0, f64::max))
    }

    /// Returns the share of the power that standing walls but for those of a body let pass to a
    /// scatterer, and the power of its echo without them, in the receiver's units.
    fn echo(&self, there: &Scatterer, own: u32) -> [f64; 2] {
        let ray = self.place - there.position;
        let range_m = ray.norm().max(1.0);
        let passed = self
            .world
            .transmission(self.place, there.position, own, 1e-4);
        let power = there.cross_section_m2
            * there.aspect.gain(ray / range_m)
            * self.receiver.sensitivity(range_m);
        [passed, power]
    }

    /// Returns the share of the power that the walls of a road user let pass to a place.
    fn passed(&self, moving: &Moving<'_>, place: &Point2<f64>) -> f64 {
        let line = place - self.place;
        let crosses = |wall: &Wall| crossing(self.place, line, &wall.moved(&moving.pose)).is_some();
        let walls = moving.body.walls.iter().filter(|wall| crosses(wall));
        walls.map(|wall| wall.transmission).product()
    }
}

impl Kind {
    /// Returns the name.
    fn name(self) -> &'static str {
        match self {
            Self::Car => "car",
            Self::Van => "van",
            Self::Lorry => "lorry",
            Self::Bus => "bus",
            Self::Cyclist => "cyclist",
            Self::Pedestrian => "pedestrian",
        }
    }
}
