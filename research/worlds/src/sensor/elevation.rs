//! Elevation: the beam has a height of a few degrees, and the vehicle pitches and
//! rolls.
//!
//! Each scatterer stands for a column of a facade, a trunk or a car, of which the beam illuminates
//! one height. At short range it illuminates a small part of the column, and another one as the
//! vehicle pitches, so returns come and go from scan to scan.

use std::f64::consts::{LN_2, TAU};

use nalgebra::Point2;
use rand::Rng;
use rand_distr::StandardNormal;

use crate::place_noise::place_hash;
use crate::stream::Stream;

/// Maximum height of scatterers above and below the radar, metres.
const HEIGHT_M: f64 = 1.6;
/// Cross-section at which a scatterer is half a point and half a vertical line, square metres.
const UPRIGHT_M2: f64 = 4.0;
/// Pitch and roll of a car on its springs, standard deviation, radians.
const NODDING_RAD: f64 = 0.008;
/// Frequencies of pitch and roll, hertz.
const NODDING_HZ: std::ops::Range<f64> = 0.7..2.2;
/// Number of oscillations for each axis.
const OSCILLATIONS: usize = 4;

#[derive(Clone, Copy, Debug)]
struct Oscillation {
    amplitude_rad: f64,
    frequency_hz: f64,
    phase: f64,
}

/// The pitch and roll of the vehicle.
#[derive(Clone, Debug)]
pub(crate) struct PitchRoll {
    pitch: [Oscillation; OSCILLATIONS],
    roll: [Oscillation; OSCILLATIONS],
}

impl PitchRoll {
    /// Draws the oscillations; one seed is one drive.
    pub fn new(seed: u64) -> Self {
        let mut rng = Stream::PitchRoll.generator(seed);
        let mut oscillation = || Oscillation {
            amplitude_rad: NODDING_RAD
                * (2.0 / OSCILLATIONS as f64).sqrt()
                * rng.sample::<f64, _>(StandardNormal),
            frequency_hz: rng.random_range(NODDING_HZ),
            phase: rng.random_range(0.0..TAU),
        };
        Self {
            pitch: std::array::from_fn(|_| oscillation()),
            roll: std::array::from_fn(|_| oscillation()),
        }
    }

    /// Elevation of the beam at an azimuth (clockwise from ahead) and a time, radians.
    pub fn elevation_rad(&self, time_s: f64, azimuth_rad: f64) -> f64 {
        let sum = |all: &[Oscillation]| -> f64 {
            all.iter()
                .map(|o| o.amplitude_rad * (TAU * o.frequency_hz * time_s + o.phase).sin())
                .sum()
        };
        sum(&self.pitch) * azimuth_rad.cos() + sum(&self.roll) * azimuth_rad.sin()
    }
}

/// Share of the beam's power that illuminates a scatterer, for a beam with the elevation
/// `elevation_rad`. Strong scatterers are vertical lines (posts, corners), which are always
/// illuminated at some height.
pub(super) fn elevation_gain(
    height_m: f64,
    cross_section_m2: f64,
    range_m: f64,
    elevation_rad: f64,
    beam_height_rad: f64,
) -> f64 {
    let spot = spot_gain(height_m / range_m - elevation_rad, beam_height_rad);
    let upright = upright(cross_section_m2);
    spot + (1.0 - spot) * upright
}

/// Share of the beam's power at an angle above its axis, radians.
pub(super) fn spot_gain(above_rad: f64, beam_height_rad: f64) -> f64 {
    let off = above_rad / beam_height_rad;
    (-4.0 * LN_2 * off * off).exp()
}

/// Share of a scatterer that is a vertical line, 0 to 1.
fn upright(cross_section_m2: f64) -> f64 {
    cross_section_m2 / (cross_section_m2 + UPRIGHT_M2)
}

/// Height above the radar, metres, of the point that a scatterer reflects from: a vertical line
/// does so where it is level with the radar.
pub(super) fn slant_height_m(place: Point2<f64>, cross_section_m2: f64) -> f64 {
    height_m(place) * (1.0 - upright(cross_section_m2))
}

/// The height of a scatterer above the radar, metres: pseudo-random, by its place.
pub(super) fn height_m(place: Point2<f64>) -> f64 {
    HEIGHT_M * (2.0 * place_hash(place, 0) - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heights_are_uniformly_distributed() {
        let heights: Vec<f64> = (0..10_000)
            .map(|i| height_m(Point2::new(f64::from(i) * 0.1, 7.0)))
            .collect();
        let mean = heights.iter().sum::<f64>() / 1e4;
        let spread = (heights.iter().map(|h| h * h).sum::<f64>() / 1e4).sqrt();
        assert!(
            mean.abs() < 0.05 && (spread - HEIGHT_M / 3f64.sqrt()).abs() < 0.05,
            "{mean} {spread}"
        );
    }

    #[test]
    fn a_raised_beam_loses_far_and_keeps_high_scatterers() {
        let place = (0..10_000)
            .map(|i| Point2::new(f64::from(i), 0.0))
            .find(|p| height_m(*p) > 0.97 * HEIGHT_M)
            .unwrap_or_default();
        assert!(
            elevation_gain(height_m(place), 0.1, 1e4, 0.0, 0.045) > 0.99
                && elevation_gain(height_m(place), 0.1, 1e4, 0.05, 0.045) < 0.1
        );
        assert!(
            elevation_gain(height_m(place), 0.1, HEIGHT_M / 0.05, 0.05, 0.045) > 0.9
                && elevation_gain(height_m(place), 0.1, 10.0, 0.0, 0.045) < 0.05
        );
        assert!(
            elevation_gain(height_m(place), 0.1, 10.0, 0.0, 0.25) > 0.3,
            "a fan beam illuminates it"
        );
    }
}
