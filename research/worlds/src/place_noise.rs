//! Pseudo-random numbers that depend on the place alone, so that they are the same in every scan.

use nalgebra::{Point2, Vector2};

/// A number from 0 to 1 for a place; each `index` gives another one.
pub(crate) fn place_hash(place: Point2<f64>, index: u64) -> f64 {
    // The finaliser of SplitMix64 (Steele et al. 2014) over both coordinates' bits.
    let mut bits = place.x.to_bits()
        ^ place.y.to_bits().rotate_left(32)
        ^ index.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((bits ^ (bits >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

/// A random field over the world, smooth on the scale `size_m`, with a mean of 0, a standard
/// deviation of about 1 and a maximum of 2.7. Each `index` gives another one.
pub(crate) fn smooth_noise(place: Point2<f64>, size_m: f64, index: u64) -> f64 {
    let at = place / size_m;
    let corner = Point2::new(at.x.floor(), at.y.floor());
    // Smooth weights, which hide the grid.
    let share = (at - corner).map(|share| share * share * (3.0 - 2.0 * share));
    let value = |x: f64, y: f64| 2.0 * place_hash(corner + Vector2::new(x, y), index) - 1.0;
    let along = |y: f64| value(0.0, y) * (1.0 - share.x) + value(1.0, y) * share.x;
    // The mean of four numbers with a standard deviation of one over the square root of three has
    // 0.42 on average.
    (along(0.0) * (1.0 - share.y) + along(1.0) * share.y) / 0.42
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_smooth_and_has_the_stated_deviation() {
        let place = |i: u32| Point2::new(f64::from(i) * 0.7 - 4000.0, f64::from(i % 97) * 1.3);
        let values: Vec<f64> = (0..20_000)
            .map(|i| smooth_noise(place(i), 14.0, 3))
            .collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let spread = (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt();
        assert!(
            mean.abs() < 0.1 && (0.8..1.2).contains(&spread),
            "{mean} {spread}"
        );
        let near = |i: u32| {
            (smooth_noise(place(i), 14.0, 3)
                - smooth_noise(place(i) + Vector2::new(0.1, 0.1), 14.0, 3))
            .abs()
        };
        assert!((0..1000).all(|i| near(i) < 0.1));
    }
}
