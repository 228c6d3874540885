//! Dirt on the radome: it attenuates some sectors, the same ones in all scans of a drive.
//!
//! A dirty radome in rain loses 3 dB two-way at C band (Kurri and Huuskonen 2008). Number, width
//! and loss of the spots at 77 GHz are assumed.

use std::f64::consts::{PI, TAU};

use rand::Rng;

use crate::stream::Stream;

/// Number of dirty spots.
const SPOTS: usize = 5;
/// Half-width of a spot, radians: drips and splashes on a radome of 0.3 m.
const HALF_WIDTH_RAD: std::ops::Range<f64> = 0.03..0.2;
/// Two-way loss in its middle, decibels.
const LOSS_DB: std::ops::Range<f64> = 1.0..8.0;

#[derive(Clone, Copy, Debug)]
struct Spot {
    middle_rad: f64,
    half_width_rad: f64,
    loss_db: f64,
}

/// The dirt on a radome.
#[derive(Clone, Debug, Default)]
pub(super) struct Radome {
    spots: Vec<Spot>,
}

impl Radome {
    /// A dirty radome; one seed is one drive.
    pub fn dirty(seed: u64) -> Self {
        let mut rng = Stream::Dirt.generator(seed);
        let spot = |_| Spot {
            middle_rad: rng.random_range(0.0..TAU),
            half_width_rad: rng.random_range(HALF_WIDTH_RAD),
            loss_db: rng.random_range(LOSS_DB),
        };
        Self {
            spots: (0..SPOTS).map(spot).collect(),
        }
    }

    /// Two-way amplitude that passes at an azimuth of the radar; 1 through a clean radome.
    pub fn amplitude(&self, azimuth_rad: f64) -> f64 {
        let loss_db = |spot: &Spot| {
            let off_rad = (azimuth_rad - spot.middle_rad + PI).rem_euclid(TAU) - PI;
            spot.loss_db * (-(off_rad / spot.half_width_rad).powi(2)).exp()
        };
        10f64.powf(-self.spots.iter().map(loss_db).sum::<f64>() / 20.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clean_radome_passes_all_and_a_dirty_one_loses_up_to_its_spots() {
        assert_eq!(Radome::default().amplitude(1.0), 1.0);
        let radome = Radome::dirty(4);
        let all: Vec<f64> = (0..400)
            .map(|i| radome.amplitude(f64::from(i) * TAU / 400.0))
            .collect();
        let worst = all.iter().copied().fold(1.0, f64::min);
        let clean = all.iter().filter(|passed| **passed > 0.97).count();
        assert!(
            (0.2..0.9).contains(&worst) && clean > 150,
            "{worst} {clean}"
        );
        assert!((radome.amplitude(0.0) - radome.amplitude(TAU)).abs() < 1e-12);
    }
}
