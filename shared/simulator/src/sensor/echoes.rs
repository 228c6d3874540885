//! The echoes of a sweep, with amplitudes by cross-section, aspect, occlusion and range.

use nalgebra::{Point2, Vector2};

use super::line_of_sight::LineOfSight;
use super::scintillation::scintillation;
use super::sweep_poses::{AzimuthPose, SweepPoses};
use crate::body::{Moving, Scatterer};
use crate::profile::Receiver;
use crate::world::World;

pub(super) const NEGLIGIBLE_POWER: f64 = 0.05;
const NEAREST_M: f64 = 0.5;

#[derive(Clone, Copy, Debug)]
pub(super) struct Echo {
    position: Point2<f64>,
    /// Velocity, metres a second, world frame.
    pub velocity: Vector2<f64>,
    /// Amplitude on the beam's axis: the square root of the received power.
    pub amplitude: f64,
    /// The azimuth when the beam passes it, with fractions.
    pub azimuth: f64,
}

impl Echo {
    pub fn place(&self, azimuth_pose: &AzimuthPose) -> Point2<f64> {
        self.position + self.velocity * azimuth_pose.time_s
    }
}

pub(super) struct View<'a> {
    pub sweep_poses: &'a SweepPoses,
    pub line_of_sight: &'a LineOfSight,
    pub receiver: &'a Receiver,
    pub fluctuates: bool,
    pub reach_m: f64,
}

impl View<'_> {
    pub fn standing(&self, world: &World, echoes: &mut Vec<Echo>) {
        let centre = self.sweep_poses.middle().position;
        for scatterer in world.around(centre, self.reach_m).flatten() {
            self.add_echoes(scatterer, Vector2::zeros(), echoes);
        }
    }

    pub fn moving(&self, moving: &[Moving<'_>], echoes: &mut Vec<Echo>) {
        for mover in moving {
            for scatterer in &mover.body.scatterers {
                self.add_echoes(&scatterer.moved(&mover.pose), mover.velocity, echoes);
            }
        }
    }

    /// Adds a scatterer's echo for each pass of the beam, unless it is negligible.
    fn add_echoes(&self, scatterer: &Scatterer, velocity: Vector2<f64>, echoes: &mut Vec<Echo>) {
        let position = scatterer.position;
        let range_m = (position - self.sweep_poses.middle().position).norm();
        let nearest_m = (range_m - 5.0).max(NEAREST_M);
        if scatterer.cross_section_m2 * self.receiver.sensitivity(nearest_m) < NEGLIGIBLE_POWER {
            return;
        }
        let place = |azimuth_pose: &AzimuthPose| position + velocity * azimuth_pose.time_s;
        self.sweep_poses.beam_passes(place, |azimuth| {
            let azimuth_pose = self.sweep_poses.at(azimuth);
            let power = self.power(scatterer, place(azimuth_pose), azimuth_pose, azimuth);
            if power > NEGLIGIBLE_POWER {
                echoes.push(Echo {
                    position,
                    velocity,
                    amplitude: power.sqrt(),
                    azimuth,
                });
            }
        });
    }

    fn power(
        &self,
        scatterer: &Scatterer,
        place: Point2<f64>,
        from: &AzimuthPose,
        azimuth: f64,
    ) -> f64 {
        let ray = from.position - place;
        let range_m = ray.norm();
        if !(NEAREST_M..self.reach_m).contains(&range_m) {
            return 0.0;
        }
        let direction = ray / range_m;
        let fluctuation = match self.fluctuates {
            true => scintillation(scatterer.position, direction),
            false => 1.0,
        };
        let in_sight = scatterer.cross_section_m2
            * scatterer.gain(direction)
            * fluctuation
            * self.receiver.sensitivity(range_m);
        if in_sight < NEGLIGIBLE_POWER {
            return 0.0;
        }
        let passed = self
            .line_of_sight
            .transmission(azimuth, range_m, scatterer.body);
        in_sight * f64::from(passed)
    }
}
