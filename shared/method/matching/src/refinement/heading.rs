//! The heading by gyro and radar together: a Kalman filter over the heading against the map, the
//! bias of the gyro and its scale, and the yaw bias of registration.
//!
//! The gyro predicts the heading of the next scan, and registration measures it against the map.
//! While the vehicle stands the map stays, so that the bias is observed well. While it drives, the
//! map is rebuilt from its own scans and follows a wrong bias; and a small steady error of
//! registration, the *yaw bias*, drags the map along as a gyro bias would. The covariance includes
//! both.

use gyre_geometry::{
    Pose, UncertainMotion, pose,
    samples::{GyroConfig, GyroTurn},
    wrap_angle, xy_yaw,
};
use nalgebra::{Matrix4, RowVector4, Vector4};
use serde::{Deserialize, Serialize};

/// Square of what gyro, wheels or Doppler and the radar are apart, over its variance, beyond which
/// one of them is wrong: four standard deviations.
pub(super) const GATE: f64 = 16.0;
/// Standard deviation of the yaw bias of registration, rad, and the time over which it changes, s.
/// A map that lags by 1.4 s drifts with it by 0.1 degrees in a minute, as the radar alone does on
/// six simulated roads.
const YAW_BIAS_SIGMA_RAD: f64 = 4e-5;
const YAW_BIAS_TIME_S: f64 = 60.0;
/// Noise of the turn about the vertical where the gyro's axis tilts with the vehicle, rad/√s. It is
/// the residual of the best bias and scale in the turns over 4 to 16 s on six simulated roads,
/// whose gradient is 2.6 % RMS along and across.
const TILT_RAD_PER_SQRT_S: f64 = 3e-4;
/// Time over which an error of the bias counts as new, s: for covariances of motions, which are
/// composed as if independent.
const BIAS_TIME_S: f64 = 30.0;
/// Angle after which an error of the scale counts as new, rad: a bend.
const SCALE_TURN_RAD: f64 = std::f64::consts::FRAC_PI_2;

/// The states, in the order of the covariance.
const HEADING: usize = 0;
const BIAS: usize = 1;
const YAW_BIAS: usize = 2;
const SCALE: usize = 3;
/// The part that each has in a registered heading against the predicted one.
const SEEN: RowVector4<f64> = RowVector4::new(1.0, 0.0, 1.0, 0.0);

/// The bias and the scale of the gyro, and the steady error of the radar.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Heading {
    pub bias_radps: f64,
    pub yaw_bias_rad: f64,
    /// True turn over the one that is measured, but for the bias. With one that the gyro cannot
    /// have ([`GyroConfig::allows_scale`]) it is not used any more.
    pub scale: f64,
    /// Covariance of the errors of the heading against the map, the bias, the yaw bias and the
    /// scale.
    pub covariance: Matrix4<f64>,
    pub verdict: Verdict,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Verdict {
    /// Noise can bring both so far apart.
    #[default]
    Agrees,
    /// Noise cannot, but a match can err by so much: they are weighed all the same.
    Doubted,
    /// The gyro is wrong: it is not used.
    Refused,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GyroBias {
    pub rate_radps: f64,
    pub sigma_radps: f64,
    pub scale: f64,
    pub verdict: Verdict,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct PredictedTurn {
    pub yaw_rad: f64,
    pub variance_rad2: f64,
    pub sweep_rate_radps: f64,
    /// The part of the variance that is of neither bias nor scale.
    noise_rad2: f64,
    /// Variance of the bias, rad²/s², and of the scale.
    bias_radps2: f64,
    scale_variance: f64,
    interval_s: f64,
}

impl PredictedTurn {
    /// Returns the variance after a time, s, and an angle, rad, with all turns by the gyro, such
    /// that the variances of all turns add up, rad². The errors of bias and scale are common to
    /// all: their squares grow with the squares of the time and of the angle.
    pub fn variance_after_rad2(&self, [time_s, angle_rad]: [f64; 2]) -> f64 {
        self.noise_rad2
            + self.bias_radps2 * grown(self.interval_s, time_s)
            + self.scale_variance * grown(self.yaw_rad, angle_rad)
    }

    pub fn is_certain(&self) -> bool {
        self.yaw_rad.powi(2) > GATE * self.variance_rad2
    }

    /// The registered heading against the predicted one, rad. `previous` is the pose of the scan
    /// before.
    fn apart_rad(&self, registered: &UncertainMotion, previous: &Pose) -> f64 {
        let yaw_rad = registered.motion.rotation.angle();
        wrap_angle(yaw_rad - previous.rotation.angle() - self.yaw_rad)
    }
}

/// By how much the square of a sum grows with a step, at least by the square of that.
pub(super) fn grown(step: f64, sum: f64) -> f64 {
    (step * (step + 2.0 * sum)).max(step * step)
}

impl Heading {
    pub(super) fn new(config: &GyroConfig) -> Self {
        let [bias, scale] = [config.bias_sigma_radps, config.scale_sigma].map(|it| it * it);
        let variances = Vector4::new(0.0, bias, YAW_BIAS_SIGMA_RAD.powi(2), scale);
        Self {
            bias_radps: config.bias_radps,
            yaw_bias_rad: 0.0,
            scale: 1.0,
            covariance: Matrix4::from_diagonal(&variances),
            verdict: Verdict::Agrees,
        }
    }

    pub(super) fn bias(&self) -> GyroBias {
        GyroBias {
            rate_radps: self.bias_radps,
            sigma_radps: self.covariance[(BIAS, BIAS)].max(0.0).sqrt(),
            scale: self.scale,
            verdict: self.verdict,
        }
    }

    pub(super) fn predict(&mut self, turn: &GyroTurn, config: &GyroConfig) -> PredictedTurn {
        let time_s = turn.interval_s;
        let turn_rad2 = turn.variance_rad2 + TILT_RAD_PER_SQRT_S.powi(2) * time_s;
        let mut step = Matrix4::identity();
        (step[(HEADING, BIAS)], step[(HEADING, SCALE)]) = (-time_s, turn.yaw_rad);
        self.covariance = step * self.covariance * step.transpose();
        self.covariance[(HEADING, HEADING)] += turn_rad2;
        self.propagate(time_s, config);
        let bias_radps2 = self.covariance[(BIAS, BIAS)];
        let scale_variance = self.covariance[(SCALE, SCALE)];
        let angle_rad = turn.yaw_rad.abs();
        PredictedTurn {
            yaw_rad: self.scale * turn.yaw_rad - self.bias_radps * time_s,
            variance_rad2: turn_rad2
                + bias_radps2 * time_s * BIAS_TIME_S.max(time_s)
                + scale_variance * angle_rad * SCALE_TURN_RAD.max(angle_rad),
            sweep_rate_radps: self.scale * turn.sweep_rate_radps - self.bias_radps,
            noise_rad2: turn_rad2,
            bias_radps2,
            scale_variance,
            interval_s: time_s,
        }
    }

    /// Propagates the state over a time without a gyro measurement of the turn: the gyro's bias and
    /// the yaw bias change, and so does the heading. Either [`reset_to`](Self::reset_to) or
    /// [`inflate`](Self::inflate) sets the heading.
    pub(super) fn propagate(&mut self, time_s: f64, config: &GyroConfig) {
        let kept = (-time_s / YAW_BIAS_TIME_S).exp();
        let step = Matrix4::from_diagonal(&Vector4::new(1.0, 1.0, kept, 1.0));
        self.covariance = step * self.covariance * step;
        self.covariance[(BIAS, BIAS)] += config.bias_walk_radps_per_sqrt_s.powi(2) * time_s;
        self.covariance[(YAW_BIAS, YAW_BIAS)] += YAW_BIAS_SIGMA_RAD.powi(2) * (1.0 - kept * kept);
        self.yaw_bias_rad *= kept;
    }

    /// Takes the heading of a pose that was registered with the map, whatever it was before: the
    /// gyro has not measured the turn. That is the correction of a prediction without any
    /// certainty, so that only the yaw bias is taken off. The error is the yaw bias's, which the
    /// bias may share, plus the noise of registration. The place moves along as in
    /// [`update`](Self::update).
    pub(super) fn reset_to(
        &mut self,
        registered: &UncertainMotion,
        previous: &Pose,
    ) -> UncertainMotion {
        let variance_rad2 = registered.covariance[(2, 2)];
        let mut step = Matrix4::identity();
        (step[(HEADING, HEADING)], step[(HEADING, YAW_BIAS)]) = (0.0, -1.0);
        self.covariance = step * self.covariance * step.transpose();
        self.covariance[(HEADING, HEADING)] += variance_rad2;
        UncertainMotion {
            motion: turned(registered, previous, -self.yaw_bias_rad),
            ..*registered
        }
    }

    /// Takes a heading that neither the gyro nor the map has measured: one that is predicted from
    /// the motions before, with this variance.
    pub(super) fn inflate(&mut self, variance_rad2: f64) {
        self.covariance[(HEADING, HEADING)] += variance_rad2;
    }

    /// Compares a registered heading with the predicted one, where single matches err by up to
    /// `jitter_rad`.
    pub(super) fn gate(
        &self,
        registered: &UncertainMotion,
        previous: &Pose,
        turn: &PredictedTurn,
        jitter_rad: f64,
    ) -> Verdict {
        let apart_rad = turn.apart_rad(registered, previous) - self.yaw_bias_rad;
        let variance_rad2 = (SEEN * self.covariance * SEEN.transpose())[0];
        if apart_rad.powi(2) <= GATE * (variance_rad2 + registered.covariance[(2, 2)]) {
            Verdict::Agrees
        } else if apart_rad.abs() <= jitter_rad {
            Verdict::Doubted
        } else {
            Verdict::Refused
        }
    }

    /// Weighs the heading of a pose that was registered with the map against the predicted one. The
    /// place moves along as far as its error depends on the heading's. `previous` is the pose of
    /// the scan before, `drift_share` the share of the covariance that accumulates.
    pub(super) fn update(
        &mut self,
        registered: &UncertainMotion,
        previous: &Pose,
        turn: &PredictedTurn,
        drift_share: f64,
    ) -> UncertainMotion {
        let covariance = registered.covariance;
        let variance_rad2 = covariance[(2, 2)];
        let apart = turn.apart_rad(registered, previous);
        let step_rad = self.correct(apart, variance_rad2) - apart;
        // The gyro's error accumulates whole.
        let kept = variance_rad2.min(turn.variance_rad2 / drift_share) - variance_rad2;
        let by_yaw = covariance.column(2) / variance_rad2;
        UncertainMotion {
            motion: turned(registered, previous, step_rad),
            covariance: covariance + by_yaw * by_yaw.transpose() * kept,
        }
    }

    /// Takes a registered heading that differs by `apart_rad` from the predicted one. Returns the
    /// correction of the predicted one.
    fn correct(&mut self, apart_rad: f64, variance_rad2: f64) -> f64 {
        let across = self.covariance * SEEN.transpose();
        let gain = across / ((SEEN * across)[0] + variance_rad2);
        let step = gain * (apart_rad - self.yaw_bias_rad);
        self.bias_radps += step[BIAS];
        self.yaw_bias_rad += step[YAW_BIAS];
        self.scale += step[SCALE];
        // Joseph's form stays symmetric and positive.
        let kept = Matrix4::identity() - gain * SEEN;
        self.covariance =
            kept * self.covariance * kept.transpose() + gain * gain.transpose() * variance_rad2;
        step[HEADING]
    }

    /// A new map starts with the scan before: its heading is the map's.
    pub(super) fn start_map(&mut self) {
        let step = Matrix4::from_diagonal(&Vector4::new(0.0, 1.0, 1.0, 1.0));
        self.covariance = step * self.covariance * step;
    }

    /// The map has a new keyframe, one of `keyframes`: its heading follows the heading of the
    /// scans.
    pub(super) fn add_keyframe(&mut self, keyframes: usize) {
        let kept = 1.0 - 2.0 / (keyframes as f64 + 1.0);
        let step = Matrix4::from_diagonal(&Vector4::new(kept, 1.0, 1.0, 1.0));
        self.covariance = step * self.covariance * step;
    }
}

/// The registered pose, turned by an angle: the place moves along as far as its error depends on
/// the heading's. Its covariance is along the axes of the scan before, whose pose is `previous`,
/// and the pose along the axes of the map.
fn turned(registered: &UncertainMotion, previous: &Pose, angle_rad: f64) -> Pose {
    let covariance = registered.covariance;
    let step = covariance.column(2) * (angle_rad / covariance[(2, 2)]);
    let shift = previous.rotation * step.xy();
    let [x_m, y_m, yaw_rad] = xy_yaw(&registered.motion);
    pose(x_m + shift.x, y_m + shift.y, yaw_rad + angle_rad)
}

#[cfg(test)]
mod tests;
