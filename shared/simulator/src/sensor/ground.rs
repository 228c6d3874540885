//! What the ground itself sends back: road, verges, lawns and fields, in patches that rise towards the radar or fall away.

use nalgebra::{Point2, Vector2};

use super::place_hash::place_hash;
use crate::profile::Receiver;

/// Backscatter of a square metre of ground at a grazing angle, middle value, dB: dry asphalt at 77 GHz; rough grass is 20 dB above it.
const REFLECTIVITY_DB: f64 = -50.0;
/// How much patches differ from that, standard deviation, dB, and how large they are, metres.
const PATCHES_DB: f64 = 11.0;
const PATCH_M: f64 = 14.0;

/// Power from the ground in one resolution cell, had the way to it nothing in it.
pub(super) fn ground_power(place: Point2<f64>, range_m: f64, receiver: &Receiver) -> f64 {
    let area_m2 = range_m * receiver.beam_rad * receiver.cell_m;
    let reflectivity = 10f64.powf((REFLECTIVITY_DB + PATCHES_DB * patches(place)) / 10.0);
    reflectivity * area_m2 * receiver.sensitivity(range_m)
}

/// A random field over the world, smooth over a patch, with a mean of 0 and a standard deviation of about 1.
fn patches(place: Point2<f64>) -> f64 {
    let at = place / PATCH_M;
    let corner = Point2::new(at.x.floor(), at.y.floor());
    let share = at - corner;
    let value = |x: f64, y: f64| 2.0 * place_hash(corner + Vector2::new(x, y), 0) - 1.0;
    let along = |y: f64| value(0.0, y) * (1.0 - share.x) + value(1.0, y) * share.x;
    // A mean of four numbers, each spread by one over the root of three, is spread by 0.38 on average.
    (along(0.0) * (1.0 - share.y) + along(1.0) * share.y) / 0.38
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patches_are_smooth_and_spread_as_stated() {
        let place = |i: u32| Point2::new(f64::from(i) * 0.7 - 4000.0, f64::from(i % 97) * 1.3);
        let values: Vec<f64> = (0..20_000).map(|i| patches(place(i))).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let spread = (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt();
        assert!(mean.abs() < 0.1 && (0.8..1.2).contains(&spread), "{mean} {spread}");
        let near = |i: u32| (patches(place(i)) - patches(place(i) + Vector2::new(0.1, 0.1))).abs();
        assert!((0..1000).all(|i| near(i) < 0.1));
    }
}
