//! The echoes of a sweep, with amplitudes by cross-section, aspect, occlusion and range.

use std::f64::consts::TAU;

use nalgebra::{Point2, Vector2};

use super::antenna::Antenna;
use super::line_of_sight::LineOfSight;
use super::sweep_poses::{AzimuthPose, MARGIN, SweepPoses};
use crate::body::{Moving, Scatterer};
use crate::profile::Receiver;
use crate::world::World;

const NEGLIGIBLE_POWER: f64 = 0.05;
const NEAREST_M: f64 = 0.5;
/// Angular scale of a scatterer's lobes, radians: half a wavelength over its size, here some
/// fifteen centimetres.
const LOBE_RAD: f64 = 0.012;

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
        for scatterer in world.around(centre, self.reach_m) {
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

/// The numbers of the echoes by the azimuths whose beams they reach.
#[derive(Clone, Debug, Default)]
pub(super) struct BeamIndex(Vec<Vec<u32>>);

impl BeamIndex {
    pub fn sort(&mut self, echoes: &[Echo], antenna: &Antenna, sweep_poses: &SweepPoses) {
        let (azimuths, step_rad) = (sweep_poses.azimuths, sweep_poses.step_rad);
        let span = |echo: &Echo| {
            let reach =
                antenna.reach_rad((NEGLIGIBLE_POWER.sqrt() / echo.amplitude).min(1.0)) / step_rad;
            let reach = reach.min(MARGIN as f64);
            let (first, last) = (
                (echo.azimuth - reach).ceil(),
                (echo.azimuth + reach).floor(),
            );
            (first.max(0.0) as usize)..((last + 1.0).clamp(0.0, azimuths as f64) as usize)
        };
        self.0.resize_with(azimuths, Vec::new);
        self.0.iter_mut().for_each(Vec::clear);
        for (number, echo) in echoes.iter().enumerate() {
            for azimuth in span(echo) {
                self.0[azimuth].push(number as u32);
            }
        }
    }

    pub fn echoes(&self, azimuth: usize) -> &[u32] {
        &self.0[azimuth]
    }
}

/// Scintillation: real targets are some wavelengths large and have lobes, so their echoes fluctuate
/// with the direction. Returns the factor on the cross-section of a scatterer at `place`, seen from
/// `direction` (a unit vector): exponentially distributed over directions with a mean near 1
/// (Swerling case 1), and smooth.
fn scintillation(place: Point2<f64>, direction: Vector2<f64>) -> f64 {
    let lobe = direction.y.atan2(direction.x).rem_euclid(TAU) / LOBE_RAD;
    let (before, share) = (lobe.floor(), lobe.fract());
    let wave = |lobe: f64| {
        let index = 1 + 2 * lobe as u64;
        let amplitude = (-(1.0 - place_hash(place, index)).ln()).sqrt();
        let (sine, cosine) = (TAU * place_hash(place, index + 1)).sin_cos();
        Vector2::new(cosine, sine) * amplitude
    };
    // Weights whose squares add up to one keep the mean.
    let angle = share * TAU / 4.0;
    (wave(before) * angle.cos() + wave(before + 1.0) * angle.sin()).norm_squared()
}

/// A pseudo-random number from 0 to 1 that depends on the place and `index` alone, so that it is
/// the same in every scan.
fn place_hash(place: Point2<f64>, index: u64) -> f64 {
    // The finaliser of SplitMix64 (Steele et al. 2014) over both coordinates' bits.
    let mut bits = place.x.to_bits()
        ^ place.y.to_bits().rotate_left(32)
        ^ index.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((bits ^ (bits >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn power_is_exponentially_distributed_about_one_and_smooth() {
        let place = Point2::new(12.5, -3.25);
        let at = |angle: f64| scintillation(place, Vector2::new(angle.cos(), angle.sin()));
        let powers: Vec<f64> = (0..60_000).map(|i| at(f64::from(i) * 1e-4)).collect();
        let mean = powers.iter().sum::<f64>() / powers.len() as f64;
        let weak = powers.iter().filter(|power| **power < 0.2).count() as f64 / powers.len() as f64;
        assert!((mean - 1.0).abs() < 0.15, "{mean}");
        assert!((weak - (1.0 - (-0.2f64).exp())).abs() < 0.06, "{weak}");
        assert!(
            powers
                .windows(2)
                .all(|pair| (pair[1] - pair[0]).abs() < 0.2)
        );
    }
}
