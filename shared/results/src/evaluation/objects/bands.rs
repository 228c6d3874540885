//! Sums over pairs of true and tracked objects, of all and of bands of range and speed.

use std::ops::Range;

use gyre_geometry::wrap_angle;
use serde::Serialize;

use super::{TrackedObject, TrueObject, distance_m, share};

pub(super) const ALL: Range<f64> = 0.0..f64::INFINITY;

/// Bands of range, m. Up to 60 m a beam of 1.8 degrees is no wider than a car, and a step of 0.9
/// degrees no wider than half of one.
pub(super) const RANGES_M: [Range<f64>; 3] = [0.0..20.0, 20.0..40.0, 40.0..f64::INFINITY];
/// Bands of speed, m/s: walking pace to a turn, a town, a road.
pub(super) const SPEEDS_MPS: [Range<f64>; 3] = [0.0..5.0, 5.0..10.0, 10.0..f64::INFINITY];

/// The figures of the objects in a band of range or speed. False positives count in the band of the
/// tracked object, the others in the band of the true object.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ObjectBand {
    /// The lower bound, m or m/s.
    pub from: f64,
    /// The upper bound, m or m/s; `None`: the band has no end.
    pub to: Option<f64>,
    pub required: usize,
    pub recall: f64,
    /// Share of the tracked ones that were matched.
    pub precision: f64,
    pub position_rmse_m: f64,
    pub velocity_rmse_mps: f64,
    pub heading_rmse_deg: f64,
}

impl ObjectBand {
    pub(super) fn line(&self, unit: &str) -> String {
        let band = match self.to {
            Some(to) => format!("{} to {to} {unit}", self.from),
            None => format!("from {} {unit}", self.from),
        };
        let [recall, precision] = [self.recall, self.precision].map(|it| 100.0 * it);
        let (position, velocity) = (self.position_rmse_m, self.velocity_rmse_mps);
        let (heading, required) = (self.heading_rmse_deg, self.required);
        format!(
            "{band:<13} recall {recall:.1} %, precision {precision:.1} %, {position:.2} m, {velocity:.2} m/s, {heading:.1} deg, of {required}"
        )
    }
}

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sums {
    pub required: usize,
    pub matched: usize,
    pub false_positives: usize,
    position_m2: f64,
    moving_pairs: usize,
    velocity_m2_s2: f64,
    heading_rad2: f64,
    nees: f64,
}

impl Sums {
    pub fn add(&mut self, truth: &TrueObject, found: Option<&TrackedObject>) {
        self.required += 1;
        let Some(found) = found else {
            return;
        };
        self.matched += 1;
        self.position_m2 += distance_m(truth, found).powi(2);
        let Some(velocity) = truth.velocity else {
            return;
        };
        let error = found.velocity - velocity;
        let inverse = found.velocity_covariance.try_inverse().unwrap_or_default();
        self.moving_pairs += 1;
        self.velocity_m2_s2 += error.norm_squared();
        self.heading_rad2 += wrap_angle(found.yaw_rad - truth.yaw_rad).powi(2);
        self.nees += (error.transpose() * inverse * error)[0] / 2.0;
    }

    pub fn velocity_nees(&self) -> f64 {
        share(self.nees, self.moving_pairs)
    }

    pub fn in_band(&self, band: &Range<f64>) -> ObjectBand {
        ObjectBand {
            from: band.start,
            to: Some(band.end).filter(|bound| bound.is_finite()),
            required: self.required,
            recall: share(self.matched as f64, self.required),
            precision: share(self.matched as f64, self.matched + self.false_positives),
            position_rmse_m: share(self.position_m2, self.matched).sqrt(),
            velocity_rmse_mps: share(self.velocity_m2_s2, self.moving_pairs).sqrt(),
            heading_rmse_deg: share(self.heading_rad2, self.moving_pairs)
                .sqrt()
                .to_degrees(),
        }
    }
}
