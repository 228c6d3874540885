//! What turns with the radar: its own ringing, and the roof that it stands on. The same in every scan, to the phase.

use std::f64::consts::TAU;

use nalgebra::Vector2;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::effects::Effects;
use super::spectrum::{NOISE_OVERLAP, RangeSpectrum};
use crate::interpolate::interpolate;
use crate::profile::{Chirp, Receiver, Sampling};
use crate::stream::Stream;

/// How ringing differs from azimuth to azimuth, standard deviation, dB, and over how many azimuths it changes.
const UNEVEN_DB: f64 = 3.0;
const SMOOTH_AZIMUTHS: usize = 12;
/// Correlation of ringing's complex amplitude from one azimuth to the next.
const ALIKE: f64 = 0.95;
/// By how much falling chirps ring louder than rising ones (Boreas-RT, FoMo), dB.
const FALLING_DB: f64 = 4.0;
/// Parts of the vehicle that show: roof rails, racks, the tail, all behind the radar.
const PARTS: usize = 10;
/// Where their random numbers begin, so that they are the same with and without ringing.
const PARTS_AT_WORD: u128 = 1 << 32;
/// How far behind they are, metres, and how far to either side of straight behind, radians.
const PARTS_M: std::ops::Range<f64> = 1.5..7.0;
const PARTS_RAD: std::ops::Range<f64> = -0.7..0.7;
/// How far they stand above the floor, dB.
const PARTS_DB: std::ops::Range<f64> = 10.0..35.0;

#[derive(Clone, Copy, Debug)]
struct Fixed {
    bin: f64,
    real: f32,
    imaginary: f32,
}

/// Echoes that are the same in every scan.
#[derive(Clone, Debug)]
pub(super) struct Carrier {
    azimuths: Vec<Vec<Fixed>>,
}

impl Carrier {
    /// Draws them; one seed is one vehicle.
    pub fn new(
        sampling: &Sampling,
        receiver: &Receiver,
        effects: &Effects,
        spectrum: &RangeSpectrum,
        seed: u64,
    ) -> Self {
        let mut rng = Stream::Carrier.generator(seed);
        let mut carrier = Self {
            azimuths: vec![Vec::new(); sampling.azimuths],
        };
        if effects.ringing {
            carrier.ring(sampling, receiver, spectrum, &mut rng);
        }
        if effects.own_vehicle {
            rng.set_word_pos(PARTS_AT_WORD);
            (0..PARTS).for_each(|_| carrier.part(sampling, receiver, &mut rng));
        }
        carrier
    }

    /// Adds what an azimuth has of it.
    pub fn add(&self, spectrum: &mut RangeSpectrum, azimuth: usize) {
        for fixed in &self.azimuths[azimuth] {
            spectrum.add(fixed.bin, fixed.real, fixed.imaginary);
        }
    }

    fn ring(
        &mut self,
        sampling: &Sampling,
        receiver: &Receiver,
        spectrum: &RangeSpectrum,
        rng: &mut ChaCha8Rng,
    ) {
        let (cells, spacing) = spectrum.noise_cells();
        let falling =
            |azimuth: usize| sampling.chirp == Chirp::Alternating && !azimuth.is_multiple_of(2);
        let louder_db: Vec<f64> = smooth_noise(sampling.azimuths, rng)
            .into_iter()
            .enumerate()
            .map(|(azimuth, uneven)| {
                UNEVEN_DB * uneven + if falling(azimuth) { FALLING_DB } else { 0.0 }
            })
            .collect();
        let end_m = receiver.ringing_db.last().map_or(0.0, |last| last.0);
        for bin in (0..cells).map(|cell| cell as f64 * spacing) {
            // By the bin, not the range: an offset of the range is the radar's own delay.
            let range_m = (bin + 0.5) * sampling.range_resolution_m;
            let level_db = interpolate(receiver.ringing_db, range_m).filter(|_| range_m <= end_m);
            let Some(level_db) = level_db else { continue };
            let waves = alike_waves(sampling.azimuths, rng);
            for ((fixed, louder_db), wave) in self.azimuths.iter_mut().zip(&louder_db).zip(waves) {
                let power = 10f64.powf((level_db + louder_db) / 10.0) / f64::from(NOISE_OVERLAP);
                let wave = wave * power.sqrt();
                fixed.push(Fixed {
                    bin,
                    real: wave.x as f32,
                    imaginary: wave.y as f32,
                });
            }
        }
    }

    fn part(&mut self, sampling: &Sampling, receiver: &Receiver, rng: &mut ChaCha8Rng) {
        let (range_m, side_rad) = (rng.random_range(PARTS_M), rng.random_range(PARTS_RAD));
        let floor_db = interpolate(receiver.floor_db, range_m).unwrap_or_default();
        let power = 10f64.powf((floor_db + rng.random_range(PARTS_DB)) / 10.0);
        let middle = (TAU / 2.0 + side_rad) / sampling.step_rad();
        // The beam's main lobe: 6 dB down one azimuth of 0.9 degrees beside it.
        let reach = 2.0 * receiver.beam_rad / sampling.step_rad();
        let phase = rng.random::<u64>();
        for azimuth in (middle - reach).ceil() as usize..=(middle + reach) as usize {
            let widths = (azimuth as f64 - middle) * sampling.step_rad() / receiver.beam_rad;
            let amplitude = (power * 10f64.powf(-1.2 * widths * widths)).sqrt();
            let echo = fixed(
                sampling.bin(range_m),
                amplitude,
                &mut ChaCha8Rng::seed_from_u64(phase),
            );
            self.azimuths[azimuth % sampling.azimuths].push(echo);
        }
    }
}

fn fixed(bin: f64, amplitude: f64, rng: &mut ChaCha8Rng) -> Fixed {
    let (sine, cosine) = (TAU * rng.random::<f64>()).sin_cos();
    Fixed {
        bin,
        real: (amplitude * cosine) as f32,
        imaginary: (amplitude * sine) as f32,
    }
}

/// Complex Gaussian numbers round a circle, of power 1 on average, each like its neighbours: an autoregressive process that ends where
/// it begins.
fn alike_waves(count: usize, rng: &mut ChaCha8Rng) -> Vec<Vector2<f64>> {
    let deviation = ((1.0 - ALIKE * ALIKE) / 2.0).sqrt();
    let fresh: Vec<Vector2<f64>> = (0..count)
        .map(|_| Vector2::new(rng.sample(StandardNormal), rng.sample(StandardNormal)) * deviation)
        .collect();
    // What a turn from nothing ends with, were it turned for ever.
    let turn = fresh
        .iter()
        .fold(Vector2::zeros(), |wave, fresh| wave * ALIKE + fresh);
    let mut wave = turn / (1.0 - ALIKE.powi(count as i32));
    let next = |fresh: &Vector2<f64>| {
        wave = wave * ALIKE + fresh;
        wave
    };
    fresh.iter().map(next).collect()
}

/// Normal numbers round a circle, smooth over some of them, with a standard deviation of about 1.
fn smooth_noise(count: usize, rng: &mut ChaCha8Rng) -> Vec<f64> {
    let white: Vec<f64> = (0..count).map(|_| rng.sample(StandardNormal)).collect();
    let mean = |at: usize| {
        (0..SMOOTH_AZIMUTHS)
            .map(|i| white[(at + i) % count])
            .sum::<f64>()
    };
    (0..count)
        .map(|at| mean(at) / (SMOOTH_AZIMUTHS as f64).sqrt())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waves_keep_their_power_and_resemble_their_neighbours_all_round_the_circle() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let circles: Vec<_> = (0..4000).map(|_| alike_waves(120, &mut rng)).collect();
        let mean = |of: &dyn Fn(&[Vector2<f64>]) -> f64| {
            circles.iter().map(|circle| of(circle)).sum::<f64>() / 4000.0
        };
        for (at, next) in [(0, 1), (60, 61), (119, 0)] {
            let power = mean(&|circle| circle[at].norm_squared());
            let alike = mean(&|circle| circle[at].dot(&circle[next]));
            assert!((power - 1.0).abs() < 0.08, "azimuth {at}: power {power}");
            assert!(
                (alike / power - ALIKE).abs() < 0.03,
                "azimuths {at} and {next}: {alike} of {power}"
            );
        }
        let across = mean(&|circle| circle[0].dot(&circle[60]));
        assert!(across.abs() < 0.1 + 2.0 * ALIKE.powi(60), "{across}");
    }
}
