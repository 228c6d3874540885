//! Echoes that are fixed to the radar: its own ringing, and the roof below it. They are the same in
//! every scan, including their phase.

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

/// Variation of the ringing over the azimuths: standard deviation, dB, and the number of azimuths
/// over which it is smoothed.
const RINGING_SPREAD_DB: f64 = 3.0;
const SMOOTH_AZIMUTHS: usize = 12;
/// Correlation of the ringing's complex amplitude between neighbouring azimuths.
const RINGING_CORRELATION: f64 = 0.95;
/// Excess of the ringing in falling chirps (Boreas-RT, FoMo), dB.
const FALLING_DB: f64 = 4.0;
/// Number of visible parts of the vehicle: roof rails, racks, the tail, all behind the radar.
const PARTS: usize = 10;
/// The start of their random numbers, which do not depend on the ringing.
const PARTS_AT_WORD: u128 = 1 << 32;
/// Their range, metres, and their angle from straight behind, radians.
const PARTS_M: std::ops::Range<f64> = 1.5..7.0;
const PARTS_RAD: std::ops::Range<f64> = -0.7..0.7;
/// Their power above the floor, dB.
const PARTS_DB: std::ops::Range<f64> = 10.0..35.0;

#[derive(Clone, Copy, Debug)]
struct FixedEcho {
    bin: f64,
    real: f32,
    imaginary: f32,
}

/// Echoes that are the same in every scan.
#[derive(Clone, Debug)]
pub(super) struct FixedEchoes {
    azimuths: Vec<Vec<FixedEcho>>,
}

impl FixedEchoes {
    /// Draws the echoes; one seed is one vehicle.
    pub fn new(
        sampling: &Sampling,
        receiver: &Receiver,
        effects: &Effects,
        spectrum: &RangeSpectrum,
        seed: u64,
    ) -> Self {
        let mut rng = Stream::FixedEchoes.generator(seed);
        let mut fixed_echoes = Self {
            azimuths: vec![Vec::new(); sampling.azimuths],
        };
        if effects.ringing {
            fixed_echoes.add_ringing(sampling, receiver, spectrum, &mut rng);
        }
        if effects.own_vehicle {
            rng.set_word_pos(PARTS_AT_WORD);
            (0..PARTS).for_each(|_| fixed_echoes.add_vehicle_part(sampling, receiver, &mut rng));
        }
        fixed_echoes
    }

    /// Adds the echoes of an azimuth.
    pub fn add(&self, spectrum: &mut RangeSpectrum, azimuth: usize) {
        for fixed in &self.azimuths[azimuth] {
            spectrum.add(fixed.bin, fixed.real, fixed.imaginary);
        }
    }

    fn add_ringing(
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
                RINGING_SPREAD_DB * uneven + if falling(azimuth) { FALLING_DB } else { 0.0 }
            })
            .collect();
        let end_m = receiver.ringing_db.last().map_or(0.0, |last| last.0);
        for bin in (0..cells).map(|cell| cell as f64 * spacing) {
            // By the bin and not the range: an offset of the range is the radar's own delay.
            let range_m = (bin + 0.5) * sampling.range_resolution_m;
            let level_db = interpolate(receiver.ringing_db, range_m).filter(|_| range_m <= end_m);
            let Some(level_db) = level_db else { continue };
            let waves = correlated_amplitudes(sampling.azimuths, rng);
            for ((fixed, louder_db), wave) in self.azimuths.iter_mut().zip(&louder_db).zip(waves) {
                let power = 10f64.powf((level_db + louder_db) / 10.0) / f64::from(NOISE_OVERLAP);
                let wave = wave * power.sqrt();
                fixed.push(FixedEcho {
                    bin,
                    real: wave.x as f32,
                    imaginary: wave.y as f32,
                });
            }
        }
    }

    fn add_vehicle_part(&mut self, sampling: &Sampling, receiver: &Receiver, rng: &mut ChaCha8Rng) {
        let (range_m, side_rad) = (rng.random_range(PARTS_M), rng.random_range(PARTS_RAD));
        let floor_db = interpolate(receiver.floor_db, range_m).unwrap_or_default();
        let power = 10f64.powf((floor_db + rng.random_range(PARTS_DB)) / 10.0);
        let middle = (TAU / 2.0 + side_rad) / sampling.step_rad();
        // The main lobe: 6 dB down at one azimuth of 0.9 degrees.
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

fn fixed(bin: f64, amplitude: f64, rng: &mut ChaCha8Rng) -> FixedEcho {
    let (sine, cosine) = (TAU * rng.random::<f64>()).sin_cos();
    FixedEcho {
        bin,
        real: (amplitude * cosine) as f32,
        imaginary: (amplitude * sine) as f32,
    }
}

/// Complex Gaussian numbers on a circle, with a mean power of 1 and correlated neighbours: a
/// periodic autoregressive process.
fn correlated_amplitudes(count: usize, rng: &mut ChaCha8Rng) -> Vec<Vector2<f64>> {
    let deviation = ((1.0 - RINGING_CORRELATION * RINGING_CORRELATION) / 2.0).sqrt();
    let fresh: Vec<Vector2<f64>> = (0..count)
        .map(|_| Vector2::new(rng.sample(StandardNormal), rng.sample(StandardNormal)) * deviation)
        .collect();
    // The state after infinitely many turns.
    let turn = fresh.iter().fold(Vector2::zeros(), |wave, fresh| {
        wave * RINGING_CORRELATION + fresh
    });
    let mut wave = turn / (1.0 - RINGING_CORRELATION.powi(count as i32));
    let next = |fresh: &Vector2<f64>| {
        wave = wave * RINGING_CORRELATION + fresh;
        wave
    };
    fresh.iter().map(next).collect()
}

/// Normal numbers on a circle, smoothed by a moving average, with a standard deviation of about 1.
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
    fn amplitudes_keep_their_power_and_correlation_all_round_the_circle() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let circles: Vec<_> = (0..4000)
            .map(|_| correlated_amplitudes(120, &mut rng))
            .collect();
        let mean = |of: &dyn Fn(&[Vector2<f64>]) -> f64| {
            circles.iter().map(|circle| of(circle)).sum::<f64>() / 4000.0
        };
        for (at, next) in [(0, 1), (60, 61), (119, 0)] {
            let power = mean(&|circle| circle[at].norm_squared());
            let alike = mean(&|circle| circle[at].dot(&circle[next]));
            assert!((power - 1.0).abs() < 0.08, "azimuth {at}: power {power}");
            assert!(
                (alike / power - RINGING_CORRELATION).abs() < 0.03,
                "azimuths {at} and {next}: {alike} of {power}"
            );
        }
        let across = mean(&|circle| circle[0].dot(&circle[60]));
        assert!(
            across.abs() < 0.1 + 2.0 * RINGING_CORRELATION.powi(60),
            "{across}"
        );
    }
}
