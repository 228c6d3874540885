//! Errors of calibration: what a recording says of the radar is not what the radar does.

use rand::Rng;
use rand_distr::StandardNormal;

use crate::stream::Stream;

/// Standard deviations. Real radars of one kind: offsets from -0.15 to -0.8 m (the constants of
/// Oxford, Boreas, MulRan and RADIATE in `configs`), bins of 0.1736 m by the data sheet and
/// 0.1757 m by GNSS, and eccentricities of 0 to 1.8 mrad.
const OFFSET_M: f64 = 0.25;
const SCALE: f64 = 0.005;
const ECCENTRICITY_RAD: f64 = 1.0e-3;

/// Deviations of a radar from what its recording says.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Miscalibration {
    /// Metres by which everything is measured too far.
    offset_m: f64,
    /// Share of the range by which it is measured too far.
    scale: f64,
    /// Additional eccentricity of the encoder's disc: cosine and sine, radians.
    pub eccentricity_rad: (f64, f64),
}

impl Miscalibration {
    /// Draws a radar; one seed is one radar.
    pub fn draw(seed: u64) -> Self {
        let mut rng = Stream::Miscalibration.generator(seed);
        let mut normal = |deviation: f64| deviation * rng.sample::<f64, _>(StandardNormal);
        let eccentric = ECCENTRICITY_RAD / 2f64.sqrt();
        Self {
            offset_m: normal(OFFSET_M),
            scale: normal(SCALE),
            eccentricity_rad: (normal(eccentric), normal(eccentric)),
        }
    }

    /// The range at which the radar shows what is at `range_m`, metres.
    pub fn shown_m(&self, range_m: f64) -> f64 {
        range_m * (1.0 + self.scale) + self.offset_m
    }

    /// Additional deviation of the beam at an azimuth, radians.
    pub fn error_rad(&self, azimuth_rad: f64) -> f64 {
        let (cosine, sine) = self.eccentricity_rad;
        cosine * azimuth_rad.cos() + sine * azimuth_rad.sin()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn radars_deviate_by_as_much_as_stated_and_one_by_nothing() {
        let radars: Vec<Miscalibration> = (0..4000).map(Miscalibration::draw).collect();
        let spread = |of: &dyn Fn(&Miscalibration) -> f64| {
            (radars.iter().map(|radar| of(radar).powi(2)).sum::<f64>() / 4000.0).sqrt()
        };
        assert!((spread(&|radar| radar.shown_m(0.0)) - OFFSET_M).abs() < 0.01);
        assert!((spread(&|radar| radar.scale) - SCALE).abs() < 2e-4);
        let eccentricity =
            spread(&|radar| radar.eccentricity_rad.0.hypot(radar.eccentricity_rad.1));
        assert!((eccentricity - ECCENTRICITY_RAD).abs() < 5e-5);
        let exact = Miscalibration::default();
        assert_eq!((exact.shown_m(31.7), exact.error_rad(2.0)), (31.7, 0.0));
    }
}
