//! Scintillation: real objects are some wavelengths large and have lobes, so their echoes fluctuate
//! with the direction.

use std::f64::consts::TAU;

use nalgebra::{Point2, Vector2};

/// Angular scale of a scatterer's lobes, radians: half a wavelength over its size, here some
/// fifteen centimetres.
const LOBE_RAD: f64 = 0.012;

/// Factor on the cross-section of a scatterer at `place`, seen from `direction` (a unit vector):
/// exponentially distributed over directions with a mean near 1 (Swerling case 1), and smooth.
pub(super) fn scintillation(place: Point2<f64>, direction: Vector2<f64>) -> f64 {
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

/// A pseudo-random number from 0 to 1 that depends on the place and `index` alone, so that it is the
/// same in every scan.
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
