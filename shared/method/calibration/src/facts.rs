//! The facts about a radar that a drive can determine, and their effects on its points.

use gyre_geometry::SparsePoint;
use nalgebra::SVector;

pub const FACTS: usize = 3;

pub type FactVector = SVector<f64, FACTS>;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fact {
    RangeOffset,
    /// Eccentricity of the encoder: the true azimuth is the measured one plus this times its
    /// cosine, rad.
    Eccentricity,
    /// Doppler coefficient, s.
    Doppler,
}

impl Fact {
    pub const ALL: [Self; FACTS] = [Self::RangeOffset, Self::Eccentricity, Self::Doppler];

    /// Returns the standard deviation above which a drive adds nothing to the prior knowledge about
    /// any radar.
    pub(crate) fn useful_sigma(self) -> f64 {
        [0.2, 0.6e-3, 0.01][self as usize]
    }

    /// Returns the error of the method itself, which more scans do not reduce: on simulated drives
    /// whose constants are known.
    pub(crate) fn error(self) -> f64 {
        [0.03, 0.4e-3, 0.002][self as usize]
    }

    /// Returns a change of the fact for derivatives: large, since alignments are noisy.
    pub(crate) fn step(self) -> f64 {
        [0.1, 1.5e-3, 0.01][self as usize]
    }
}

/// The sense of rotation as a sign: 1 counter-clockwise, -1 clockwise.
pub(crate) type Sign = f64;

/// Moves a point as measured to where it is measured once the facts are corrected by `change`.
/// `chirp` is 1, or where chirps alternate the sign of this point's.
pub(crate) fn correct(
    point: &SparsePoint,
    change: &FactVector,
    sense: Sign,
    alternates: bool,
) -> SparsePoint {
    let [offset_m, cosine, doppler_s]: [f64; FACTS] = (*change).into();
    let (x, y) = (f64::from(point.x_m), f64::from(point.y_m));
    let (range_m, angle) = (x.hypot(y), y.atan2(x));
    let angle = angle + sense * cosine * angle.cos();
    let range_m = range_m + offset_m;
    let chirp = if alternates {
        f64::from(point.doppler_s).signum()
    } else {
        1.0
    };
    SparsePoint {
        x_m: (range_m * angle.cos()) as f32,
        y_m: (range_m * angle.sin()) as f32,
        doppler_s: point.doppler_s + (chirp * doppler_s) as f32,
        ..*point
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn where_chirps_alternate_the_shift_has_the_sign_of_the_chirp() {
        let mut change = FactVector::zeros();
        change[Fact::Doppler as usize] = 0.01;
        let shift_s = |doppler_s: f32, alternates| {
            let point = SparsePoint::from([20.0, 0.0, 0.0, 1.0, doppler_s]);
            correct(&point, &change, -1.0, alternates).doppler_s
        };
        assert!((shift_s(-0.04, true) + 0.05).abs() < 1e-6);
        assert!((shift_s(-0.04, false) + 0.03).abs() < 1e-6);
    }
}
