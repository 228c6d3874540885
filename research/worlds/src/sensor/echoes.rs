//! The echoes of a sweep, with amplitudes by cross-section, aspect, occlusion, range and weather.

use nalgebra::{Point2, Vector2};

use super::atmosphere::Atmosphere;
use super::effects::{Effects, is_on};
use super::elevation::{elevation_gain, height_m, slant_height_m};
use super::foliage::swayed;
use super::line_of_sight::LineOfSight;
use super::scintillation::scintillation;
use super::sweep_poses::{AzimuthPose, SweepPoses};
use crate::body::{Moving, NO_BODY, Scatterer};
use crate::profile::Receiver;
use crate::relief::Relief;
use crate::world::World;

/// Echoes with less power are neglected.
pub(super) const NEGLIGIBLE_POWER: f64 = 0.05;
/// Minimum range of scatterers, metres.
const NEAREST_M: f64 = 0.5;

/// An echo.
#[derive(Clone, Copy, Debug)]
pub(super) struct Echo {
    /// Position at the middle of the sweep, world frame.
    pub position: Point2<f64>,
    /// Velocity, metres a second, world frame.
    pub velocity: Vector2<f64>,
    /// Amplitude on the beam's axis: the square root of the received power.
    pub amplitude: f64,
    /// The azimuth at which the beam passes it, with fractions.
    pub azimuth: f64,
    /// Height above the radar, metres, that lengthens the way to it.
    pub height_m: f64,
}

impl Echo {
    /// Creates the echo of what stands still at the radar's height; `None` if it is negligible.
    pub fn still(position: Point2<f64>, power: f64, azimuth: f64) -> Option<Self> {
        (power > NEGLIGIBLE_POWER).then(|| Self {
            position,
            velocity: Vector2::zeros(),
            amplitude: power.sqrt(),
            azimuth,
            height_m: 0.0,
        })
    }

    /// The position at the time of an azimuth.
    pub fn place(&self, azimuth_pose: &AzimuthPose) -> Point2<f64> {
        self.position + self.velocity * azimuth_pose.time_s
    }
}

/// Everything that determines the amplitudes.
pub(super) struct View<'a> {
    pub sweep_poses: &'a SweepPoses,
    pub line_of_sight: &'a LineOfSight,
    pub receiver: &'a Receiver,
    pub atmosphere: &'a Atmosphere,
    pub effects: &'a Effects,
    pub relief: Relief,
    /// Number of the scan.
    pub scan: u64,
    pub reach_m: f64,
}

impl View<'_> {
    /// Adds the echoes of the static world.
    pub fn standing(&self, world: &World, echoes: &mut Vec<Echo>) {
        let centre = self.sweep_poses.middle().position;
        for scatterer in world.around(centre, self.reach_m).flatten() {
            if is_on(self.effects.sway) {
                let (scatterer, place) = swayed(scatterer, self.scan);
                self.add_echoes(&scatterer, place, Vector2::zeros(), echoes);
            } else {
                self.add_echoes(scatterer, scatterer.position, Vector2::zeros(), echoes);
            }
        }
    }

    /// Adds the echoes of the moving bodies.
    pub fn moving(&self, moving: &[Moving<'_>], echoes: &mut Vec<Echo>) {
        for mover in moving {
            for scatterer in &mover.body.scatterers {
                let there = scatterer.moved(&mover.pose);
                self.add_echoes(&there, there.position, mover.velocity, echoes);
            }
        }
    }

    /// Adds a scatterer's echo for each pass of the beam, unless it is negligible.
    fn add_echoes(
        &self,
        scatterer: &Scatterer,
        position: Point2<f64>,
        velocity: Vector2<f64>,
        echoes: &mut Vec<Echo>,
    ) {
        let range_m = (position - self.sweep_poses.middle().position).norm();
        if scatterer.cross_section_m2 * self.received((range_m - 5.0).max(NEAREST_M))
            < NEGLIGIBLE_POWER
        {
            return;
        }
        let place = |azimuth_pose: &AzimuthPose| position + velocity * azimuth_pose.time_s;
        self.sweep_poses.beam_passes(place, |azimuth| {
            let azimuth_pose = self.sweep_poses.at(azimuth);
            if let Some(amplitude) =
                self.amplitude(scatterer, place(azimuth_pose), azimuth_pose, azimuth)
            {
                echoes.push(Echo {
                    position,
                    velocity,
                    amplitude,
                    azimuth,
                    height_m: self.slant_m(scatterer, azimuth_pose),
                });
            }
        });
    }

    fn amplitude(
        &self,
        scatterer: &Scatterer,
        place: Point2<f64>,
        from: &AzimuthPose,
        azimuth: f64,
    ) -> Option<f64> {
        let ray = from.position - place;
        let range_m = ray.norm();
        if !(NEAREST_M..self.reach_m).contains(&range_m) {
            return None;
        }
        let unoccluded = self.cross_section_m2(scatterer, ray / range_m)
            * self.received(range_m)
            * self.elevation_gain(scatterer, range_m, from);
        if unoccluded < NEGLIGIBLE_POWER {
            return None;
        }
        let body = if self.effects.aspect {
            scatterer.body
        } else {
            NO_BODY
        };
        let passed = self.transmission(azimuth, range_m, body);
        (unoccluded * passed > NEGLIGIBLE_POWER).then(|| (unoccluded * passed).sqrt())
    }

    /// Cross-section of a scatterer towards `direction`, a unit vector, square metres.
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

    /// Two-way share of the power that walls transmit to a scatterer of `body`.
    pub fn transmission(&self, azimuth: f64, range_m: f64, body: u32) -> f64 {
        if self.effects.occlusion {
            f64::from(self.line_of_sight.transmission(azimuth, range_m, body))
        } else {
            1.0
        }
    }

    /// Share of the beam's power at a scatterer's height, at `range_m`.
    pub fn elevation_gain(&self, scatterer: &Scatterer, range_m: f64, from: &AzimuthPose) -> f64 {
        if self.effects.elevation {
            let rise_m = self.relief.rise_m(from.position, scatterer.position);
            elevation_gain(
                height_m(scatterer.position) + rise_m,
                scatterer.cross_section_m2,
                range_m,
                from.elevation_rad,
                self.receiver.beam_height_rad,
            )
        } else {
            1.0
        }
    }

    /// Height of a scatterer above the radar that lengthens the way to it, metres.
    fn slant_m(&self, scatterer: &Scatterer, from: &AzimuthPose) -> f64 {
        if is_on(self.effects.slant_range) {
            slant_height_m(scatterer.position, scatterer.cross_section_m2)
                + self.relief.rise_m(from.position, scatterer.position)
        } else {
            0.0
        }
    }

    /// Power received from 1 m² at a range.
    pub fn received(&self, range_m: f64) -> f64 {
        self.receiver.sensitivity(range_m) * self.atmosphere.transmission(range_m)
    }
}
