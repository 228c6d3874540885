//! Random quantities of the town.
//!
//! Each object has its own generator, seeded by what and where it is, so a place looks the same
//! whatever else is built.

use std::f64::consts::TAU;

use nalgebra::Point2;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Mixes keys to a pseudo-random number (the finalizer of SplitMix64, Steele et al. 2014, for each
/// key).
pub fn hash(keys: &[u64]) -> u64 {
    keys.iter().fold(0x9e37_79b9_7f4a_7c15, |state, key| {
        let mut mixed = (state ^ key).wrapping_add(0x9e37_79b9_7f4a_7c15);
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    })
}

/// The generator of the object with these keys.
pub fn generator(keys: &[u64]) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(hash(keys))
}

/// A standard normal number (Box and Muller).
pub fn normal(rng: &mut impl Rng) -> f64 {
    let radius = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
    radius * (TAU * rng.random::<f64>()).cos()
}

/// A log-normal number with a median and a standard deviation in decibels.
pub fn spread(rng: &mut impl Rng, median: f64, deviation_db: f64) -> f64 {
    median * 10f64.powf(1.35 * deviation_db * normal(rng) / 10.0)
}

/// Positions along a line, all below `end`, with random gaps between `min` and `max`.
pub fn random_positions(rng: &mut impl Rng, end: f64, min: f64, max: f64) -> Vec<f64> {
    let mut all = Vec::new();
    let mut at = rng.random_range(0.0..max);
    while at < end {
        all.push(at);
        at += rng.random_range(min..max);
    }
    all
}

/// A smooth random function of place, 0 to 1, that changes on the scale `cell_m`, metres.
pub fn smooth(key: u64, place: Point2<f64>, cell_m: f64) -> f64 {
    let scaled = place / cell_m;
    let (column, row) = (scaled.x.floor(), scaled.y.floor());
    let ease = |t: f64| t * t * (3.0 - 2.0 * t);
    let (along, across) = (ease(scaled.x - column), ease(scaled.y - row));
    let corner = |x: i64, y: i64| {
        let mixed = hash(&[key, (column as i64 + x) as u64, (row as i64 + y) as u64]);
        (mixed >> 11) as f64 / (1u64 << 53) as f64
    };
    let below = corner(0, 0) + along * (corner(1, 0) - corner(0, 0));
    let above = corner(0, 1) + along * (corner(1, 1) - corner(0, 1));
    below + across * (above - below)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smooth_function_has_no_steps_and_fills_its_range() {
        let at = |i: i32| {
            smooth(
                7,
                Point2::new(f64::from(i), 0.3 * f64::from(i) - 500.0),
                100.0,
            )
        };
        let values: Vec<f64> = (-5000..5000).map(at).collect();
        assert!(
            values
                .windows(2)
                .all(|pair| (pair[1] - pair[0]).abs() < 0.04)
        );
        assert!(values.iter().any(|v| *v < 0.15) && values.iter().any(|v| *v > 0.85));
    }

    #[test]
    fn neighbouring_keys_give_different_generators() {
        let mut firsts: Vec<u64> = (0..1000)
            .map(|key| generator(&[1, key]).random::<u64>() >> 40)
            .collect();
        firsts.sort_unstable();
        firsts.dedup();
        assert!(firsts.len() > 995, "{}", firsts.len());
    }
}
