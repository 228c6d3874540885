//! The turn and the distance that other sensors predict, and the predicted motions since the last
//! match.

use gyre_geometry::{
    Pose, Twist, UncertainMotion, pose,
    samples::{DopplerConfig, Evidence, Witness},
};
use nalgebra::{Matrix3, Vector2, Vector3};
use serde::{Deserialize, Serialize};

use super::filter::{GATE, Predicted, Seen, grown};

/// Time over which an error of the gyro's bias counts as new, s: for covariances of motions, which
/// are composed as if independent.
const BIAS_TIME_S: f64 = 30.0;
/// Angle after which an error of the gyro's scale counts as new, rad: a bend.
const SCALE_TURN_RAD: f64 = std::f64::consts::FRAC_PI_2;

/// The measurements about a motion, in the order of [`Witness::ALL`]. The measurement by Doppler is
/// the displacement.
pub(super) type Measured = [Option<Evidence>; Witness::ALL.len()];

/// The motions whose error the next match takes back: all since the last match, or since a new map
/// was started.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct SinceMatch {
    /// The measured distance, m: also along walls.
    pub distance_m: f64,
    pub time_s: f64,
    pub turn_rad: f64,
    /// The time since a match determined the place along the path, s: also along walls.
    pub place_s: f64,
    /// Covariance of these motions together, along the axes of the last scan.
    pub covariance: Matrix3<f64>,
}

impl SinceMatch {
    pub(super) fn add(&mut self, predicted: &UncertainMotion, time_s: f64) {
        let before = UncertainMotion {
            motion: Pose::identity(),
            covariance: self.covariance,
        };
        let turn = predicted.motion.rotation.inverse().to_rotation_matrix();
        let turn = turn.to_homogeneous();
        self.covariance = turn * before.then(predicted).covariance * turn.transpose();
        self.time_s += time_s;
        self.turn_rad += predicted.motion.rotation.angle();
    }
}

/// The turn that the gyro predicts.
#[derive(Debug, Clone, Copy)]
pub(super) struct PredictedTurn {
    pub of: Predicted,
    /// The rate during the sweep.
    pub sweep_rate_radps: f64,
}

impl PredictedTurn {
    pub fn new(of: Predicted, sweep_rate_radps: f64) -> Self {
        Self {
            of,
            sweep_rate_radps,
        }
    }

    /// From the tracker's pose to the predicted heading in the map.
    pub fn yaw_rad(&self) -> f64 {
        self.of.in_map
    }

    pub fn variance_rad2(&self) -> f64 {
        self.of.variance_with([BIAS_TIME_S, SCALE_TURN_RAD])
    }

    /// Returns the variance such that the variances of all turns since the last match add up, rad².
    pub fn variance_after_rad2(&self, since: &SinceMatch) -> f64 {
        self.of.variance_after([since.time_s, since.turn_rad])
    }

    pub fn is_certain(&self) -> bool {
        self.of.change.powi(2) > GATE * self.variance_rad2()
    }

    /// Returns the covariance of a registered motion, weighed with this turn. `drift_share` is the
    /// share of the covariance that accumulates; the error of the gyro accumulates whole.
    pub fn covariance(&self, registered: &Matrix3<f64>, drift_share: f64) -> Matrix3<f64> {
        let variance_rad2 = registered[(2, 2)];
        let less = variance_rad2.min(self.variance_rad2() / drift_share) - variance_rad2;
        let by_yaw = registered.column(2) / variance_rad2;
        registered + by_yaw * by_yaw.transpose() * less
    }
}

/// The distance that wheels or Doppler predict.
#[derive(Debug, Clone, Copy)]
pub(super) struct PredictedDistance {
    pub by: Witness,
    /// Distance since the scan before, m; negative backwards.
    change_m: f64,
    /// From the tracker's pose to the predicted place in the map, m.
    distance_m: f64,
    /// Displacement to the left of the heading in the middle, m.
    left_m: f64,
    /// Variance of the distance, m², such that the variances of the motions since the last
    /// registered one add up.
    variance_m2: f64,
    side_variance_m2: f64,
    /// Distance of the radar ahead of the axle that does not steer, m.
    radar_ahead_m: f64,
}

impl PredictedDistance {
    pub fn new(
        by: Witness,
        predicted: &Predicted,
        [left_m, side_variance_m2]: [f64; 2],
        radar_ahead_m: f64,
        since: &SinceMatch,
    ) -> Self {
        let lasting_m2 = match by {
            Witness::Doppler => lasting_m2(predicted.interval_s, since.place_s),
            _ => 0.0,
        };
        let variance_m2 = predicted.variance_after([since.time_s, since.distance_m]);
        Self {
            by,
            change_m: predicted.change,
            distance_m: predicted.in_map,
            left_m,
            variance_m2: variance_m2 + lasting_m2,
            side_variance_m2: side_variance_m2 + lasting_m2,
            radar_ahead_m,
        }
    }

    /// Returns the motion to the next scan, which turns by an angle with a variance: the axle that
    /// does not steer drives along an arc.
    pub fn motion(&self, [yaw_rad, variance_rad2]: [f64; 2]) -> UncertainMotion {
        let arc = Twist {
            vx_mps: self.distance_m,
            vy_mps: self.left_m,
            yaw_rate_radps: yaw_rad,
        };
        let ahead = pose(self.radar_ahead_m, 0.0, 0.0);
        let axle = arc.pose_at(1.0);
        let (sin, cos) = (0.5 * yaw_rad).sin_cos();
        let along = Vector3::new(cos, sin, 0.0);
        let across = Vector3::new(-sin, cos, 0.0);
        // The chord turns by half of an error of the turn, and the radar about the axle by all of
        // it.
        let lever = axle.rotation * Vector2::new(0.0, self.radar_ahead_m);
        let turn = across * (0.5 * self.distance_m) + Vector3::new(lever.x, lever.y, 1.0);
        UncertainMotion {
            motion: ahead.inverse() * axle * ahead,
            covariance: along * along.transpose() * self.variance_m2
                + across * across.transpose() * self.side_variance_m2
                + turn * turn.transpose() * variance_rad2,
        }
    }

    /// By how much the motion in the map is longer, m: it takes back the error of the last match.
    pub fn taken_back_m(&self) -> f64 {
        self.distance_m - self.change_m
    }

    pub fn is_certain(&self) -> bool {
        self.change_m.powi(2) > GATE * self.variance_m2
    }
}

/// Returns the variance by the lasting error of a velocity by Doppler, m²: an error of all motions
/// since the last match that determined the place. The displacements state the noise of each scan.
fn lasting_m2(interval_s: f64, since_place_s: f64) -> f64 {
    let before_s = (since_place_s - interval_s).max(0.0);
    let lasting = grown(interval_s, before_s) - interval_s.powi(2);
    DopplerConfig::NOISE_MPS.powi(2) * lasting
}

/// The distance of a registered motion along the path of the axle that does not steer. Of the
/// variance `drift_share` accumulates.
pub(super) fn seen_distance(
    motion: &UncertainMotion,
    radar_ahead_m: f64,
    drift_share: f64,
) -> Seen {
    let ahead = pose(radar_ahead_m, 0.0, 0.0);
    let axle = ahead * motion.motion * ahead.inverse();
    let (sin, cos) = (0.5 * motion.motion.rotation.angle()).sin_cos();
    let along = Vector3::new(cos, sin, 0.0);
    let variance_m2 = (along.transpose() * motion.covariance * along)[0];
    let drift = drift_share * variance_m2;
    Seen {
        change: Twist::from_motion(&axle, 1.0).vx_mps,
        jitter: 0.5 * (variance_m2 - drift),
        drift,
    }
}

#[cfg(test)]
mod tests;
