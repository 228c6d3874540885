//! Random quantities that the town is made of.

use std::f64::consts::TAU;

use rand::Rng;

/// A standard normal number (Box and Muller).
pub fn normal(rng: &mut impl Rng) -> f64 {
    let radius = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
    radius * (TAU * rng.random::<f64>()).cos()
}

/// A log-normal number: `median`, times or divided by a spread given in decibels (one standard deviation).
pub fn spread(rng: &mut impl Rng, median: f64, deviation_db: f64) -> f64 {
    median * 10f64.powf(deviation_db * normal(rng) / 10.0)
}

/// Distances along a line with random gaps between `least` and `most`, beginning with such a gap, all below `end`.
pub fn stations(rng: &mut impl Rng, end: f64, least: f64, most: f64) -> Vec<f64> {
    let mut all = Vec::new();
    let mut at = rng.random_range(0.0..most);
    while at < end {
        all.push(at);
        at += rng.random_range(least..most);
    }
    all
}
