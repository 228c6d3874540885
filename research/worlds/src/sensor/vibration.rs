//! A mount that vibrates: during a sweep the beam swings about the bearing that the encoder
//! reports, in another way in each sweep.

use std::f64::consts::TAU;

use rand::Rng;
use rand_distr::StandardNormal;

use crate::stream::Stream;

/// Swings of the beam in a turn, 4 to 24 Hz at 4 turns a second: a car's body and its engine.
const HARMONICS: usize = 6;
/// Standard deviation of the bearing, radians: 0.02 degrees. Assumed; rotations found between scans
/// of the standing vehicle of RADIATE scatter by 0.03 degrees, which bounds it.
const VIBRATION_RAD: f64 = 3.5e-4;

/// The vibration of the mount in one sweep.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Vibration {
    /// Amplitudes of cosine and sine by harmonic, radians.
    waves: [(f64, f64); HARMONICS],
}

impl Vibration {
    /// Draws the vibration of a scan.
    pub fn draw(seed: u64, scan: u64) -> Self {
        let mut rng = Stream::Vibration(scan).generator(seed);
        let mut wave =
            || VIBRATION_RAD / (HARMONICS as f64).sqrt() * rng.sample::<f64, _>(StandardNormal);
        Self {
            waves: std::array::from_fn(|_| (wave(), wave())),
        }
    }

    /// Deviation of the beam at an azimuth, radians.
    pub fn error_rad(&self, azimuth_rad: f64) -> f64 {
        let wave = |(number, (cosine, sine)): (usize, &(f64, f64))| {
            let (s, c) = ((number + 1) as f64 * azimuth_rad.rem_euclid(TAU)).sin_cos();
            cosine * c + sine * s
        };
        self.waves.iter().enumerate().map(wave).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bearing_has_the_stated_deviation_and_differs_between_scans() {
        let square = |scan: u64| {
            Vibration::draw(3, scan)
                .error_rad(scan as f64 * 0.1)
                .powi(2)
        };
        let spread = ((0..20_000).map(square).sum::<f64>() / 2e4).sqrt();
        assert!((spread / VIBRATION_RAD - 1.0).abs() < 0.03, "{spread}");
        let at = |scan| Vibration::draw(3, scan).error_rad(1.0);
        assert!(at(0) != at(1) && at(0) == at(0));
    }
}
