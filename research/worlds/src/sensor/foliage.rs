//! Foliage that sways: the echoes of leaves and twigs are others in each turn of the antenna.
//!
//! A quarter of a wavelength is 1 mm, and a turn takes a quarter of a second: from one scan to the
//! next the wind moves leaves by far more (Billingsley 2002, Low-Angle Radar Land Clutter, on the
//! spectra of windblown foliage), which draws their speckle anew, and turns some of them.

use nalgebra::{Point2, Vector2};

use crate::body::{Aspect, NO_BODY, Scatterer};
use crate::place_noise::place_hash;

/// Cross-section above which what stands alone is a trunk or a post and keeps still, square metres.
const LEAVES_M2: f64 = 0.6;
/// Deflection of leaves and twigs, standard deviation, metres (assumed; a light wind).
const SWAY_M: f64 = 0.03;
/// Share of the power that is drawn anew: the rest is of twigs and of the mean of many leaves
/// (assumed).
const STIRRED: f64 = 0.5;
/// The first of the numbers of a place that belong to scans.
const FIRST_INDEX: u64 = 1 << 32;

/// The scatterer as it is during a scan, and where: its own position stays, since its height and
/// its lobes belong to that.
pub(super) fn swayed(scatterer: &Scatterer, scan: u64) -> (Scatterer, Point2<f64>) {
    let sways = scatterer.body == NO_BODY
        && scatterer.aspect == Aspect::AllRound
        && scatterer.cross_section_m2 < LEAVES_M2;
    if !sways {
        return (*scatterer, scatterer.position);
    }
    let draw = |number: u64| place_hash(scatterer.position, FIRST_INDEX + 4 * scan + number);
    // Uniform numbers with this standard deviation.
    let deflection = Vector2::new(draw(0) - 0.5, draw(1) - 0.5) * (12f64.sqrt() * SWAY_M);
    let lobe = -(1.0 - draw(2)).ln();
    let cross_section_m2 = scatterer.cross_section_m2 * (1.0 - STIRRED + STIRRED * lobe);
    let stirred = Scatterer {
        cross_section_m2,
        ..*scatterer
    };
    (stirred, scatterer.position + deflection)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn leaves_keep_their_mean_power_and_trunks_keep_still() {
        let place = Point2::new(3.0, 4.0);
        let leaf = Scatterer::all_round(place, 0.1, NO_BODY);
        let scans: Vec<_> = (0..20_000).map(|scan| swayed(&leaf, scan)).collect();
        let power = scans.iter().map(|(leaf, _)| leaf.cross_section_m2);
        assert!((power.sum::<f64>() / 2e4 - 0.1).abs() < 0.003);
        let squares = scans.iter().map(|(_, there)| (there.x - 3.0).powi(2));
        let spread = (squares.sum::<f64>() / 2e4).sqrt();
        assert!((spread - SWAY_M).abs() < 0.002, "{spread}");
        let trunk = Scatterer::all_round(place, 2.0, NO_BODY);
        assert_eq!(swayed(&trunk, 7), (trunk, place));
        let house = Scatterer { body: 4, ..leaf };
        assert_eq!(swayed(&house, 7), (house, place));
    }
}
