//! What a sweep can see: everything that reflects, with the amplitude that size, aspect, cover, range and air leave of it.

use nalgebra::{Point2, Vector2};

use super::atmosphere::Atmosphere;
use super::effects::Effects;
use super::elevation::lit;
use super::scintillation::scintillation;
use super::skyline::Skyline;
use super::stations::{Station, Stations};
use crate::body::{Moving, NO_BODY, Scatterer};
use crate::profile::Receiver;
use crate::world::World;

/// Echoes with less power than this are not worth adding.
pub(super) const NEGLIGIBLE_POWER: f64 = 0.05;
/// Nothing reflects nearer than this, metres: it would be inside the radar.
const NEAREST_M: f64 = 0.5;

/// Something visible.
#[derive(Clone, Copy, Debug)]
pub(super) struct Echo {
    /// Where it is at the middle of the sweep, world frame.
    pub position: Point2<f64>,
    /// How it moves, metres a second, world frame.
    pub velocity: Vector2<f64>,
    /// Amplitude in the middle of the beam: the root of the power received.
    pub amplitude: f64,
    /// When the beam passes it, in azimuths with fractions.
    pub azimuth: f64,
}

impl Echo {
    /// Where it is when the sensor is at a station.
    pub fn place(&self, station: &Station) -> Point2<f64> {
        self.position + self.velocity * station.time_s
    }
}

/// What looking needs to know.
pub(super) struct View<'a> {
    pub stations: &'a Stations,
    pub skyline: &'a Skyline,
    pub receiver: &'a Receiver,
    pub atmosphere: &'a Atmosphere,
    pub effects: &'a Effects,
    pub reach_m: f64,
}

impl View<'_> {
    /// Collects all that stands.
    pub fn standing(&self, world: &World, echoes: &mut Vec<Echo>) {
        let centre = self.stations.middle().position;
        for scatterer in world.around(centre, self.reach_m).flatten() {
            self.look(scatterer, scatterer.position, Vector2::zeros(), echoes);
        }
    }

    /// Collects all that moves.
    pub fn moving(&self, moving: &[Moving<'_>], echoes: &mut Vec<Echo>) {
        for mover in moving {
            for scatterer in &mover.body.scatterers {
                let there = scatterer.moved(&mover.pose);
                self.look(&there, there.position, mover.velocity, echoes);
            }
        }
    }

    /// Adds a scatterer's echo for each time that the beam passes it, if there is enough of it.
    fn look(
        &self,
        scatterer: &Scatterer,
        position: Point2<f64>,
        velocity: Vector2<f64>,
        echoes: &mut Vec<Echo>,
    ) {
        let range_m = (position - self.stations.middle().position).norm();
        if scatterer.cross_section_m2 * self.received((range_m - 5.0).max(NEAREST_M))
            < NEGLIGIBLE_POWER
        {
            return;
        }
        let place = |station: &Station| position + velocity * station.time_s;
        self.stations.passings(place, |azimuth| {
            let station = self.stations.at(azimuth);
            if let Some(amplitude) = self.amplitude(scatterer, place(station), station, azimuth) {
                echoes.push(Echo {
                    position,
                    velocity,
                    amplitude,
                    azimuth,
                });
            }
        });
    }

    fn amplitude(
        &self,
        scatterer: &Scatterer,
        place: Point2<f64>,
        from: &Station,
        azimuth: f64,
    ) -> Option<f64> {
        let way = from.position - place;
        let range_m = way.norm();
        if !(NEAREST_M..self.reach_m).contains(&range_m) {
            return None;
        }
        let in_the_open = self.cross_section_m2(scatterer, way / range_m)
            * self.received(range_m)
            * self.lit(scatterer, range_m, from);
        if in_the_open < NEGLIGIBLE_POWER {
            return None;
        }
        let body = if self.effects.aspect {
            scatterer.body
        } else {
            NO_BODY
        };
        let passed = self.transmission(azimuth, range_m, body);
        (in_the_open * passed > NEGLIGIBLE_POWER).then(|| (in_the_open * passed).sqrt())
    }

    /// Cross-section that a scatterer shows towards `direction`, a unit vector, square metres.
    pub fn cross_section_m2(&self, scatterer: &Scatterer, direction: Vector2<f64>) -> f64 {
        let aspect = &scatterer.aspect;
        let facing = if self.effects.aspect {
            aspect.gain(direction)
        } else {
            aspect.mean_gain()
        };
        let flicker = if self.effects.scintillation {
            scintillation(scatterer.position, direction)
        } else {
            1.0
        };
        scatterer.cross_section_m2 * facing * flicker
    }

    /// Share of the power that walls let through to a thing of `body`, there and back.
    pub fn transmission(&self, azimuth: f64, range_m: f64, body: u32) -> f64 {
        if self.effects.occlusion {
            f64::from(self.skyline.transmission(azimuth, range_m, body))
        } else {
            1.0
        }
    }

    /// Share of the power that the beam has at a scatterer's height, seen over a way of `range_m`.
    pub fn lit(&self, scatterer: &Scatterer, range_m: f64, from: &Station) -> f64 {
        if self.effects.elevation {
            lit(
                scatterer.position,
                scatterer.cross_section_m2,
                range_m,
                from.lift_rad,
                self.receiver.beam_height_rad,
            )
        } else {
            1.0
        }
    }

    /// Power received from 1 m2 at a range: the fourth power of range, and the receiver's gain, which rises with it.
    pub fn received(&self, range_m: f64) -> f64 {
        self.receiver.sensitivity(range_m) * self.atmosphere.passed(range_m)
    }
}
