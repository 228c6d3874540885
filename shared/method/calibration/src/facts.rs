//! The facts about a radar that a drive can determine, and their effects on its points.

use gyre_geometry::SparsePoint;
use nalgebra::{SMatrix, SVector, Vector2};

pub const FACTS: usize = 3;

pub type FactVector = SVector<f64, FACTS>;

pub type FactMatrix = SMatrix<f64, FACTS, FACTS>;

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
    pub fn useful_sigma(self) -> f64 {
        [0.2, 0.6e-3, 0.01][self as usize]
    }

    /// Returns a small change of the fact, for derivatives.
    pub fn step(self) -> f64 {
        [0.05, 1e-3, 0.01][self as usize]
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

/// Returns the derivatives by the facts of where a point is seen, in the sensor's frame: two rows,
/// one column for each fact. `chirp` is the sign of its Doppler shift.
pub(crate) fn displacements(
    seen: Vector2<f64>,
    chirp: f64,
    velocity_mps: &Vector2<f64>,
    sense: Sign,
) -> SMatrix<f64, 2, FACTS> {
    let range_m = seen.norm().max(1e-3);
    let along = seen / range_m;
    let across = Vector2::new(-along.y, along.x);
    SMatrix::from_columns(&[
        along,
        across * (range_m * sense * along.x),
        along * (chirp * along.dot(velocity_mps)),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn displacements_are_the_derivatives_of_the_correction() {
        let point = SparsePoint::from([20.0, -15.0, 0.06, 0.5, 0.04]);
        let seen = Vector2::new(20.0, -15.0);
        for sense in [-1.0, 1.0] {
            let by_facts = displacements(seen, 1.0, &Vector2::zeros(), sense);
            for fact in [Fact::RangeOffset, Fact::Eccentricity] {
                let mut change = FactVector::zeros();
                change[fact as usize] = fact.step();
                let moved = correct(&point, &change, sense, false);
                let moved = Vector2::new(f64::from(moved.x_m), f64::from(moved.y_m)) - seen;
                let expected = by_facts.column(fact as usize) * fact.step();
                assert!(
                    (moved - expected).norm() < 1e-4,
                    "{fact:?}: {moved} for {expected}"
                );
            }
        }
    }

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
