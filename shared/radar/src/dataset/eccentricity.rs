//! An encoder whose disc sits a little beside the antenna's axis.

use std::f32::consts::TAU;

/// Puts azimuths right by the first harmonic of an encoder's error: `azimuth + eccentricity * cos(azimuth)`.
///
/// A disc off its axis by a tenth of a millimetre at a radius of 40 mm is wrong by 2.5 mrad, to one side ahead and to the
/// other behind. All that passes then seems to turn a little, and odometry with it: by about that angle over the distance to
/// the scene, a metre driven. The sine's part squeezes the picture from the sides and turns nothing.
pub(crate) fn correct(azimuth_rad: &mut [f32], eccentricity_rad: f32) {
    if eccentricity_rad == 0.0 {
        return;
    }
    for azimuth in azimuth_rad {
        let right = (*azimuth + eccentricity_rad * azimuth.cos()).rem_euclid(TAU);
        // Rounding can bring a small negative angle to the whole turn.
        *azimuth = if right < TAU { right } else { 0.0 };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ahead_and_behind_move_to_opposite_sides_and_stay_within_a_turn() {
        let mut azimuths = [0.0, 0.25 * TAU, 0.5 * TAU, 0.75 * TAU];
        correct(&mut azimuths, -0.01);
        let expected = [TAU - 0.01, 0.25 * TAU, 0.5 * TAU + 0.01, 0.75 * TAU];
        assert!(
            azimuths
                .iter()
                .zip(expected)
                .all(|(a, e)| (a - e).abs() < 1e-6),
            "{azimuths:?}"
        );
        let mut tiny = [f32::MIN_POSITIVE];
        correct(&mut tiny, -1e-9);
        assert!((0.0..TAU).contains(&tiny[0]), "{tiny:?}");
    }
}
