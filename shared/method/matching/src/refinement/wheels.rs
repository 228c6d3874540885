//! The distance by the wheels beside the distance by the radar's matches: a Kalman filter over the
//! place along the path against the map, and the scale of the wheels. The displacement by Doppler
//! has a filter of its own, since it is a distance with a scale too: the scale of the Doppler
//! coefficient.

use gyre_geometry::{
    Pose, Twist, UncertainMotion, pose,
    samples::{WheelDistance, WheelsConfig},
};
use nalgebra::{Matrix2, Matrix3, RowVector3, Vector2, Vector3};
use serde::{Deserialize, Serialize};

use super::{
    Witnessed,
    heading::{GATE, Verdict, grown},
};

/// Random walk of the scale, /√s: tyres that warm change it by 0.06 % in an hour.
const SCALE_WALK_PER_SQRT_S: f64 = 1e-5;
/// Least standard deviation of a scale around 1: the settings may be for other tyres.
const TYRES: f64 = 0.02;

#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct WheelState {
    pub scale: f64,
    /// Error of the last pose along the path, against the map, m.
    pub offset_m: f64,
    pub covariance: Matrix2<f64>,
    /// The last registered distance differed from the wheels' distance, or the implied scale is
    /// implausible.
    pub slips: bool,
    /// The distance by the wheels since the last registered scan, m.
    pub since_match_m: f64,
    pub since_match_s: f64,
    pub since_match_rad: f64,
    /// The time since a match last determined the place along the path, s: also along walls.
    pub since_place_s: f64,
    /// Covariance of the predicted motions since then together, or since a new map was started:
    /// along the axes of the last scan.
    pub unmatched: Matrix3<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum DistanceBy {
    Wheels,
    Doppler,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct PredictedDistance {
    pub by: DistanceBy,
    /// Distance since the scan before, m; negative backwards.
    pub distance_m: f64,
    /// Displacement to the left of the heading in the middle, m, by Doppler.
    pub left_m: f64,
    /// Variance of the distance, m², such that the variances of the motions since the last
    /// registered one add up.
    pub variance_m2: f64,
    pub side_variance_m2: f64,
    /// Distance of the radar ahead of the axle that does not steer, m.
    pub radar_ahead_m: f64,
    /// Time, s, and turn, rad, from the last registered scan to the scan before.
    pub since_match: [f64; 2],
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Registered {
    distance_m: f64,
    variance_m2: f64,
    /// The share of the variance that accumulates.
    drift_share: f64,
}

impl Registered {
    pub fn of(motion: &UncertainMotion, drift_share: f64, config: &WheelsConfig) -> Self {
        let ahead = pose(config.radar_ahead_m, 0.0, 0.0);
        let axle = ahead * motion.motion * ahead.inverse();
        let (sin, cos) = (0.5 * motion.motion.rotation.angle()).sin_cos();
        let along = Vector3::new(cos, sin, 0.0);
        Self {
            distance_m: Twist::from_motion(&axle, 1.0).vx_mps,
            variance_m2: (along.transpose() * motion.covariance * along)[0],
            drift_share,
        }
    }

    fn noise_and_drift_m2(&self) -> [f64; 2] {
        let drift = self.drift_share * self.variance_m2;
        [0.5 * (self.variance_m2 - drift), drift]
    }
}

struct Innovation {
    apart_m: f64,
    /// The covariance of the errors of the offset before, the scale, and the offset after.
    before: Matrix3<f64>,
    seen: RowVector3<f64>,
    variance_m2: f64,
    /// The part of that which is of no state.
    noise_m2: f64,
}

impl WheelState {
    pub(super) fn new(config: &WheelsConfig) -> Self {
        Self {
            scale: 1.0,
            offset_m: 0.0,
            covariance: Matrix2::new(0.0, 0.0, 0.0, config.scale_sigma.powi(2)),
            slips: false,
            since_match_m: 0.0,
            since_match_s: 0.0,
            since_match_rad: 0.0,
            since_place_s: 0.0,
            unmatched: Matrix3::zeros(),
        }
    }

    pub(super) fn witnessed(&self, measured: f64) -> Witnessed {
        Witnessed {
            verdict: match self.slips {
                true => Verdict::Refused,
                false => Verdict::Agrees,
            },
            measured,
            scale: self.scale,
            scale_sigma: self.covariance[(1, 1)].max(0.0).sqrt(),
            bias: 0.0,
            bias_sigma: 0.0,
        }
    }

    pub(super) fn wait(&mut self, time_s: f64) {
        self.covariance[(1, 1)] += SCALE_WALK_PER_SQRT_S.powi(2) * time_s;
        self.since_place_s += time_s;
    }

    /// Predicts the distance of the next scan; `None` while the wheels slip.
    pub(super) fn predict(
        &self,
        measured: &WheelDistance,
        config: &WheelsConfig,
    ) -> Option<PredictedDistance> {
        let step_m = measured.distance_m;
        // The error of the scale is common to all motions since the last registered one: its square
        // grows with the square of the whole distance.
        let since_m2 = grown(step_m, self.since_match_m);
        (!self.slips).then_some(PredictedDistance {
            by: DistanceBy::Wheels,
            distance_m: self.scale * step_m,
            left_m: 0.0,
            variance_m2: measured.variance_m2 + self.covariance[(1, 1)] * since_m2,
            side_variance_m2: measured.side_variance_m2,
            radar_ahead_m: config.radar_ahead_m,
            since_match: [self.since_match_s, self.since_match_rad],
        })
    }

    /// Returns whether a registered distance is as near to the measured one as noise can bring it.
    /// Wheels that have slipped are to agree by the scale that is known: one that is free to move
    /// would follow them.
    pub(super) fn agrees(&self, measured: &WheelDistance, registered: &Registered) -> bool {
        let mut state = *self;
        if self.slips {
            state.covariance = Matrix2::new(self.covariance[(0, 0)], 0.0, 0.0, 0.0);
        }
        let innovation = state.innovation(measured, registered);
        innovation.apart_m.powi(2) <= GATE * innovation.variance_m2
    }

    fn innovation(&self, measured: &WheelDistance, registered: &Registered) -> Innovation {
        let [noise_m2, drift_m2] = registered.noise_and_drift_m2();
        let mut before = Matrix3::zeros();
        before
            .fixed_view_mut::<2, 2>(0, 0)
            .copy_from(&self.covariance);
        before[(2, 2)] = noise_m2;
        let seen = RowVector3::new(-1.0, measured.distance_m, 1.0);
        let noise_m2 = measured.variance_m2 + drift_m2;
        Innovation {
            apart_m: registered.distance_m - self.scale * measured.distance_m + self.offset_m,
            variance_m2: (seen * before * seen.transpose())[0] + noise_m2,
            before,
            seen,
            noise_m2,
        }
    }

    /// Compares a registered pose with the measured distance, if there is one: the distance is
    /// rejected if both disagree and the match is certain. If the motions together imply an
    /// implausible scale, the wheels have slipped: the scale is learnt again.
    pub(super) fn update(
        &mut self,
        measured: Option<&WheelDistance>,
        registered: &Registered,
        is_certain: bool,
        config: &WheelsConfig,
    ) {
        match measured {
            Some(measured) if self.agrees(measured, registered) => {
                self.correct(measured, registered);
                if is_certain && !self.has_scale_of(config) {
                    *self = Self::new(config);
                    self.reset_to(registered, true);
                }
            }
            measured => {
                let slips = self.slips || (measured.is_some() && is_certain);
                self.reset_to(registered, slips);
            }
        }
    }

    fn has_scale_of(&self, config: &WheelsConfig) -> bool {
        (self.scale - 1.0).powi(2) <= GATE * config.scale_sigma.max(TYRES).powi(2)
    }

    pub(super) fn correct(&mut self, measured: &WheelDistance, registered: &Registered) {
        let Innovation {
            apart_m,
            before,
            seen,
            variance_m2,
            noise_m2,
        } = self.innovation(measured, registered);
        let gain = before * seen.transpose() / variance_m2;
        // Joseph's form stays symmetric and positive.
        let kept = Matrix3::identity() - gain * seen;
        let after = kept * before * kept.transpose() + gain * gain.transpose() * noise_m2;
        self.scale += gain[1] * apart_m;
        self.offset_m = gain[2] * apart_m;
        self.covariance = Matrix2::new(after[(2, 2)], after[(2, 1)], after[(1, 2)], after[(1, 1)]);
        self.slips = false;
        self.reset_since_match();
    }

    /// Takes a registered pose whose distance the wheels have not measured, or where they slip.
    pub(super) fn reset_to(&mut self, registered: &Registered, slips: bool) {
        let [noise_m2, _] = registered.noise_and_drift_m2();
        self.offset_m = 0.0;
        self.covariance = Matrix2::new(noise_m2, 0.0, 0.0, self.covariance[(1, 1)]);
        self.slips = slips;
        self.reset_since_match();
    }

    fn reset_since_match(&mut self) {
        (self.since_match_m, self.since_match_s, self.since_match_rad) = (0.0, 0.0, 0.0);
        self.since_place_s = 0.0;
        self.unmatched = Matrix3::zeros();
    }

    pub(super) fn dead_reckon(&mut self, measured: &WheelDistance) {
        let step = Matrix2::new(1.0, -measured.distance_m, 0.0, 1.0);
        self.covariance = step * self.covariance * step.transpose();
        self.covariance[(0, 0)] += measured.variance_m2;
        self.since_match_m += measured.distance_m;
    }

    /// Takes a registered pose whose place along the path is the predicted one, since the map does
    /// not determine it.
    pub(super) fn propagate_along_walls(
        &mut self,
        measured: Option<&WheelDistance>,
        driven: &Registered,
    ) {
        match measured {
            Some(measured) if !self.slips => self.follow_map(measured),
            Some(measured) => self.gate_slip(measured, driven),
            None => {}
        }
    }

    /// Takes a registered pose whose place along the path comes from the wheels, since the map does
    /// not determine it: the map moves along.
    pub(super) fn follow_map(&mut self, measured: &WheelDistance) {
        self.offset_m = 0.0;
        self.covariance = Matrix2::new(measured.variance_m2, 0.0, 0.0, self.covariance[(1, 1)]);
        self.since_match_m += measured.distance_m;
    }

    /// Takes a pose whose place along the path comes from the motions before, since the map does
    /// not determine it: wheels that had slipped are used again if they agree with it.
    pub(super) fn gate_slip(&mut self, measured: &WheelDistance, driven: &Registered) {
        let apart_m = driven.distance_m - self.scale * measured.distance_m;
        let [_, variance_m2] = driven.noise_and_drift_m2();
        self.slips &= apart_m.powi(2) > GATE * (variance_m2 + measured.variance_m2);
    }

    pub(super) fn inflate(&mut self, variance_m2: f64) {
        self.covariance[(0, 0)] += variance_m2;
    }

    /// Adds a predicted motion to those whose error the next match takes back.
    pub(super) fn add_unmatched(&mut self, predicted: &UncertainMotion, time_s: f64) {
        let before = UncertainMotion {
            motion: Pose::identity(),
            covariance: self.unmatched,
        };
        let turn = predicted.motion.rotation.inverse().to_rotation_matrix();
        let turn = turn.to_homogeneous();
        self.unmatched = turn * before.then(predicted).covariance * turn.transpose();
        self.since_match_s += time_s;
        self.since_match_rad += predicted.motion.rotation.angle();
    }

    /// A new map starts with the scan before: its place is the map's.
    pub(super) fn start_map(&mut self) {
        self.offset_m = 0.0;
        self.covariance = Matrix2::new(0.0, 0.0, 0.0, self.covariance[(1, 1)]);
        self.unmatched = Matrix3::zeros();
    }
}

impl PredictedDistance {
    /// Returns the motion to the next scan, which turns by an angle with a variance: the axle that
    /// does not steer drives along an arc.
    pub(super) fn motion(&self, [yaw_rad, variance_rad2]: [f64; 2]) -> UncertainMotion {
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

    pub(super) fn is_certain(&self) -> bool {
        self.distance_m.powi(2) > GATE * self.variance_m2
    }
}

#[cfg(test)]
mod tests;
