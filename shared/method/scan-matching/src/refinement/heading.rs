//! The heading by gyro and radar together: a Kalman filter over the heading against the map, the
//! bias of the gyro, and the lean of the radar.
//!
//! The gyro predicts the heading of the next scan, and registration measures it against the map.
//! While the vehicle stands the map stays, so that the bias is seen well. While it drives, the map
//! is made anew of its own scans and follows a bias that is wrong; and a small steady error of
//! registration, the *lean*, drags the map along as a bias would. The covariance knows both.

use gyre_geometry::{Pose, UncertainMotion, pose, wrap_angle, xy_yaw};
use gyre_samples::{GyroConfig, GyroTurn};
use nalgebra::{Matrix3, RowVector3, Vector3};

/// Standard deviation of the lean, rad, and the time over which it changes, s. On simulated roads
/// 2.5e-4 rad leaves the bias unknown while the vehicle drives.
const LEAN_SIGMA_RAD: f64 = 1e-4;
const LEAN_TIME_S: f64 = 60.0;
/// Noise of the turn about the vertical where the gyro's axis tilts with the vehicle, rad/√s: that
/// of an exact gyro on simulated hills, whose roads have a gradient of 2.6 % RMS along and across.
const TILT_RAD_PER_SQRT_S: f64 = 2.5e-4;
/// Time over which an error of the bias counts as new, s: for covariances of motions, which are
/// composed as if independent.
const BIAS_TIME_S: f64 = 30.0;

/// The bias of the gyro, and the steady error of the radar.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Heading {
    /// Bias of the gyro, rad/s.
    pub bias_radps: f64,
    /// Steady error of registered headings, rad.
    pub lean_rad: f64,
    /// Covariance of the errors of the heading against the map, the bias and the lean.
    pub covariance: Matrix3<f64>,
}

/// The bias of the gyro, as it is known after a scan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GyroBias {
    /// The bias, rad/s.
    pub rate_radps: f64,
    /// Standard deviation, rad/s.
    pub sigma_radps: f64,
}

/// The heading that the gyro predicts, against the scan before.
#[derive(Debug, Clone, Copy)]
pub(super) struct PredictedTurn {
    /// Turn since the scan before, rad.
    pub yaw_rad: f64,
    /// Variance of that, rad².
    pub variance_rad2: f64,
    /// Rate during the sweep, rad/s.
    pub sweep_rate_radps: f64,
    /// The part of the variance that is not of the bias.
    noise_rad2: f64,
    /// Variance of the bias, rad²/s².
    bias_radps2: f64,
    interval_s: f64,
}

impl PredictedTurn {
    /// Returns the variance after a time, s, in which all turns were the gyro's, such that those of
    /// all of them add up, rad². The error of the bias is that of all: its square grows with the
    /// square of the time.
    pub fn variance_after_rad2(&self, time_s: f64) -> f64 {
        let since_s2 = self.interval_s * (self.interval_s + 2.0 * time_s);
        self.noise_rad2 + self.bias_radps2 * since_s2
    }
}

impl Heading {
    /// Creates the state before the first scan.
    pub(super) fn new(config: &GyroConfig) -> Self {
        let variances = Vector3::new(0.0, config.bias_sigma_radps.powi(2), LEAN_SIGMA_RAD.powi(2));
        Self {
            bias_radps: config.bias_radps,
            lean_rad: 0.0,
            covariance: Matrix3::from_diagonal(&variances),
        }
    }

    /// Returns what is known of the bias.
    pub(super) fn bias(&self) -> GyroBias {
        GyroBias {
            rate_radps: self.bias_radps,
            sigma_radps: self.covariance[(1, 1)].max(0.0).sqrt(),
        }
    }

    /// Predicts the heading of the next scan.
    pub(super) fn predict(&mut self, turn: &GyroTurn, config: &GyroConfig) -> PredictedTurn {
        let time_s = turn.interval_s;
        let turn_rad2 = turn.variance_rad2 + TILT_RAD_PER_SQRT_S.powi(2) * time_s;
        let by_bias_s = Matrix3::new(1.0, -time_s, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
        self.covariance = by_bias_s * self.covariance * by_bias_s.transpose();
        self.covariance[(0, 0)] += turn_rad2;
        self.wait(time_s, config);
        let by_bias = self.covariance[(1, 1)] * time_s * BIAS_TIME_S.max(time_s);
        PredictedTurn {
            yaw_rad: turn.yaw_rad - self.bias_radps * time_s,
            variance_rad2: turn_rad2 + by_bias,
            sweep_rate_radps: turn.sweep_rate_radps - self.bias_radps,
            noise_rad2: turn_rad2,
            bias_radps2: self.covariance[(1, 1)],
            interval_s: time_s,
        }
    }

    /// Lets a time pass whose turn the gyro has not measured: bias and lean change, and the heading
    /// is another one. Either [`adopt`](Self::adopt) or [`guess`](Self::guess) says which.
    pub(super) fn wait(&mut self, time_s: f64, config: &GyroConfig) {
        let kept = (-time_s / LEAN_TIME_S).exp();
        let step = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, kept));
        self.covariance = step * self.covariance * step;
        self.covariance[(1, 1)] += config.bias_walk_radps_per_sqrt_s.powi(2) * time_s;
        self.covariance[(2, 2)] += LEAN_SIGMA_RAD.powi(2) * (1.0 - kept * kept);
        self.lean_rad *= kept;
    }

    /// Takes the heading of a pose that was registered with the map, whatever it was before: the
    /// gyro has not measured the turn. That is the correction of a prediction without any
    /// certainty, so that the lean alone is taken off. The error is that of the lean, which the
    /// bias may share, and the noise of registration. The place moves along as in
    /// [`weigh`](Self::weigh).
    pub(super) fn adopt(
        &mut self,
        registered: &UncertainMotion,
        previous: &Pose,
    ) -> UncertainMotion {
        let variance_rad2 = registered.covariance[(2, 2)];
        let step = Matrix3::new(0.0, 0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
        self.covariance = step * self.covariance * step.transpose();
        self.covariance[(0, 0)] += variance_rad2;
        UncertainMotion {
            motion: turned(registered, previous, -self.lean_rad),
            ..*registered
        }
    }

    /// Takes a heading that neither the gyro nor the map has measured: one that is predicted from
    /// the motions before, with this variance.
    pub(super) fn guess(&mut self, variance_rad2: f64) {
        self.covariance[(0, 0)] += variance_rad2;
    }

    /// Weighs the heading of a pose that was registered with the map against the predicted one. The
    /// place moves along as far as its error depends on that of the heading. `previous` is the pose
    /// of the scan before, `drift_share` the share of the covariance that accumulates.
    pub(super) fn weigh(
        &mut self,
        registered: &UncertainMotion,
        previous: &Pose,
        turn: &PredictedTurn,
        drift_share: f64,
    ) -> UncertainMotion {
        let covariance = registered.covariance;
        let variance_rad2 = covariance[(2, 2)];
        let yaw_rad = registered.motion.rotation.angle();
        let apart = wrap_angle(yaw_rad - previous.rotation.angle() - turn.yaw_rad);
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
        let seen = RowVector3::new(1.0, 0.0, 1.0);
        let across = self.covariance * seen.transpose();
        let gain = across / ((seen * across)[0] + variance_rad2);
        let step = gain * (apart_rad - self.lean_rad);
        self.bias_radps += step[1];
        self.lean_rad += step[2];
        // Joseph's form stays symmetric and positive.
        let kept = Matrix3::identity() - gain * seen;
        self.covariance =
            kept * self.covariance * kept.transpose() + gain * gain.transpose() * variance_rad2;
        step[0]
    }

    /// A new map starts with the scan before: its heading is that of the map.
    pub(super) fn start_map(&mut self) {
        let step = Matrix3::from_diagonal(&Vector3::new(0.0, 1.0, 1.0));
        self.covariance = step * self.covariance * step;
    }

    /// The map has a new keyframe, one of `keyframes`: its heading follows that of the scans.
    pub(super) fn follow(&mut self, keyframes: usize) {
        let kept = 1.0 - 2.0 / (keyframes as f64 + 1.0);
        let step = Matrix3::from_diagonal(&Vector3::new(kept, 1.0, 1.0));
        self.covariance = step * self.covariance * step;
    }
}

/// The pose that was registered, turned by an angle: the place moves along as far as its error
/// depends on that of the heading. Its covariance is along the axes of the scan before, whose pose
/// is `previous`, and the pose along those of the map.
fn turned(registered: &UncertainMotion, previous: &Pose, angle_rad: f64) -> Pose {
    let covariance = registered.covariance;
    let step = covariance.column(2) * (angle_rad / covariance[(2, 2)]);
    let shift = previous.rotation * step.xy();
    let [x_m, y_m, yaw_rad] = xy_yaw(&registered.motion);
    pose(x_m + shift.x, y_m + shift.y, yaw_rad + angle_rad)
}

#[cfg(test)]
mod tests;
