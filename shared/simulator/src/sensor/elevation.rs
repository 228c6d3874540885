//! The third dimension, as far as a plane world needs it: the beam is a few degrees high, and the vehicle pitches and rolls.
//!
//! Each scatterer stands for a column of a facade, a trunk or a car, lit at one height. What is near shows a small part of its
//! column; and as the vehicle nods, another one. So returns come and go from scan to scan.

use std::f64::consts::{LN_2, TAU};

use nalgebra::Point2;
use rand::Rng;
use rand_distr::StandardNormal;

use super::place_noise::place_hash;
use crate::stream::Stream;

/// Heights of scatterers about the radar's, metres: this much up or down.
const HEIGHT_M: f64 = 1.6;
/// Cross-section of what is half a spot and half an upright, square metres.
const UPRIGHT_M2: f64 = 4.0;
/// Nodding of a car on its springs, standard deviation, radians.
const NODDING_RAD: f64 = 0.008;
/// Its frequencies, hertz.
const NODDING_HZ: std::ops::Range<f64> = 0.7..2.2;
/// Oscillations that it is made of, for each axis.
const OSCILLATIONS: usize = 4;

#[derive(Clone, Copy, Debug)]
struct Oscillation {
    amplitude_rad: f64,
    frequency_hz: f64,
    phase: f64,
}

/// How the vehicle pitches and rolls.
#[derive(Clone, Debug)]
pub(super) struct Nodding {
    pitch: [Oscillation; OSCILLATIONS],
    roll: [Oscillation; OSCILLATIONS],
}

impl Nodding {
    /// A vehicle's; one seed is one drive.
    pub fn new(seed: u64) -> Self {
        let mut rng = Stream::Nodding.generator(seed);
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

    /// How far the beam points up at an azimuth (clockwise from ahead) and a time, radians.
    pub fn lift_rad(&self, time_s: f64, azimuth_rad: f64) -> f64 {
        let sum = |all: &[Oscillation]| -> f64 {
            all.iter()
                .map(|o| o.amplitude_rad * (TAU * o.frequency_hz * time_s + o.phase).sin())
                .sum()
        };
        sum(&self.pitch) * azimuth_rad.cos() + sum(&self.roll) * azimuth_rad.sin()
    }
}

/// Share of the power that a scatterer gets from a beam of a height that points up by `lift_rad`. What is strong stands upright (posts,
/// corners) and is lit at some height in any case.
pub(super) fn lit(
    place: Point2<f64>,
    cross_section_m2: f64,
    range_m: f64,
    lift_rad: f64,
    beam_height_rad: f64,
) -> f64 {
    let off = (height_m(place) / range_m - lift_rad) / beam_height_rad;
    let spot = (-4.0 * LN_2 * off * off).exp();
    let upright = cross_section_m2 / (cross_section_m2 + UPRIGHT_M2);
    spot + (1.0 - spot) * upright
}

/// The height of what stands at a place, metres above the radar: as good as random, and always the same.
fn height_m(place: Point2<f64>) -> f64 {
    HEIGHT_M * (2.0 * place_hash(place, 0) - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heights_fill_their_span_evenly() {
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
    fn a_beam_that_points_up_loses_what_is_far_and_keeps_what_is_high() {
        let place = (0..10_000)
            .map(|i| Point2::new(f64::from(i), 0.0))
            .find(|p| height_m(*p) > 0.97 * HEIGHT_M)
            .unwrap_or_default();
        assert!(lit(place, 0.1, 1e4, 0.0, 0.045) > 0.99 && lit(place, 0.1, 1e4, 0.05, 0.045) < 0.1);
        assert!(
            lit(place, 0.1, HEIGHT_M / 0.05, 0.05, 0.045) > 0.9
                && lit(place, 0.1, 10.0, 0.0, 0.045) < 0.05
        );
        assert!(lit(place, 0.1, 10.0, 0.0, 0.25) > 0.3, "a fan lights it");
    }
}
