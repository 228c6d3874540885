//! Correction of an encoder disc that is mounted off the antenna's axis.

use std::f32::consts::TAU;

/// Corrects azimuths by the first harmonic of the encoder error:
/// `azimuth + eccentricity * cos(azimuth)`.
///
/// A disc that is 0.1 mm off its axis, at a radius of 40 mm, causes an error of 2.5 mrad, with
/// opposite signs ahead and behind. The scene then appears to rotate while the vehicle moves, and
/// the odometry drifts in yaw: per metre by about that angle over the distance to the scene. The
/// sine term compresses the scan laterally and causes no drift.
pub fn correct_eccentricity(azimuth_rad: &mut [f32], eccentricity_rad: f32) {
    if eccentricity_rad == 0.0 {
        return;
    }
    for azimuth in azimuth_rad {
        let corrected = (*azimuth + eccentricity_rad * azimuth.cos()).rem_euclid(TAU);
        // Rounding can give exactly one turn for a small negative angle.
        *azimuth = if corrected < TAU { corrected } else { 0.0 };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ahead_and_behind_shift_in_opposite_directions_and_stay_within_a_turn() {
        let mut azimuths = [0.0, 0.25 * TAU, 0.5 * TAU, 0.75 * TAU];
        correct_eccentricity(&mut azimuths, -0.01);
        let expected = [TAU - 0.01, 0.25 * TAU, 0.5 * TAU + 0.01, 0.75 * TAU];
        assert!(
            azimuths
                .iter()
                .zip(expected)
                .all(|(a, e)| (a - e).abs() < 1e-6),
            "{azimuths:?}"
        );
        let mut tiny = [f32::MIN_POSITIVE];
        correct_eccentricity(&mut tiny, -1e-9);
        assert!((0.0..TAU).contains(&tiny[0]), "{tiny:?}");
    }
}
