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
        let kept = (-time_s / LEAN_TIME_S).exp();
        let step = Matrix3::new(1.0, -time_s, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, kept);
        let turn_rad2 = turn.variance_rad2 + TILT_RAD_PER_SQRT_S.powi(2) * time_s;
        let noise = Vector3::new(
            turn_rad2,
            config.bias_walk_radps_per_sqrt_s.powi(2) * time_s,
            LEAN_SIGMA_RAD.powi(2) * (1.0 - kept * kept),
        );
        self.covariance =
            step * self.covariance * step.transpose() + Matrix3::from_diagonal(&noise);
        self.lean_rad *= kept;
        let by_bias = self.covariance[(1, 1)] * time_s * BIAS_TIME_S.max(time_s);
        PredictedTurn {
            yaw_rad: turn.yaw_rad - self.bias_radps * time_s,
            variance_rad2: turn_rad2 + by_bias,
            sweep_rate_radps: turn.sweep_rate_radps - self.bias_radps,
        }
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
        let [x_m, y_m, yaw_rad] = xy_yaw(&registered.motion);
        let apart = wrap_angle(yaw_rad - previous.rotation.angle() - turn.yaw_rad);
        let by_yaw = covariance.column(2) / variance_rad2;
        let step = by_yaw * (self.correct(apart, variance_rad2) - apart);
        // The covariance is along the axes of the scan before, the pose along those of the map.
        let shift = previous.rotation * step.xy();
        // The gyro's error accumulates whole.
        let kept = variance_rad2.min(turn.variance_rad2 / drift_share) - variance_rad2;
        UncertainMotion {
            motion: pose(x_m + shift.x, y_m + shift.y, yaw_rad + step.z),
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
        self.covariance = (Matrix3::identity() - gain * seen) * self.covariance;
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

#[cfg(test)]
mod tests {
    use super::*;

    const INTERVAL_S: f64 = 0.25;
    const BIAS_RADPS: f64 = 0.004;
    /// Standard deviation of registered headings, rad.
    const NOISE_RAD: f64 = 2e-3;

    /// Weighs a drive of `scans` scans that turns at a rate, with a gyro that has a bias. Each scan
    /// becomes a keyframe, unless the vehicle stands.
    fn drive(scans: u32, rate_radps: f64, keyframes: Option<usize>) -> (Heading, f64) {
        let config = GyroConfig::default();
        let mut heading = Heading::new(&config);
        let (mut at, mut truth) = (Pose::identity(), 0.0);
        for scan in 0..scans {
            truth += rate_radps * INTERVAL_S;
            let turn = GyroTurn {
                yaw_rad: (rate_radps + BIAS_RADPS) * INTERVAL_S,
                variance_rad2: 1e-10,
                interval_s: INTERVAL_S,
                sweep_rate_radps: rate_radps + BIAS_RADPS,
            };
            // Noise without a mean, and without a generator.
            let noise = NOISE_RAD * (f64::from(scan) * 2.4).sin() * 2f64.sqrt();
            let registered = UncertainMotion {
                motion: pose(0.0, 0.0, truth + noise),
                covariance: Matrix3::from_diagonal_element(NOISE_RAD * NOISE_RAD),
            };
            let predicted = heading.predict(&turn, &config);
            at = heading.weigh(&registered, &at, &predicted, 0.1).motion;
            if let Some(keyframes) = keyframes {
                heading.follow(keyframes);
            }
        }
        (heading, wrap_angle(at.rotation.angle() - truth))
    }

    #[test]
    fn a_standing_vehicle_shows_the_bias() {
        let (heading, off_rad) = drive(120, 0.0, None);
        let off_radps = heading.bias_radps - BIAS_RADPS;
        assert!(off_radps.abs() < 2e-5, "{off_radps} rad/s");
        assert!(off_rad.abs() < 5e-4, "{off_rad} rad");
        let sigma_radps = heading.covariance[(1, 1)].sqrt();
        assert!(off_radps.abs() < 3.0 * sigma_radps, "{sigma_radps} rad/s");
    }

    #[test]
    fn on_the_road_the_bias_is_never_better_known_than_the_radar_leans() {
        let [stood, driven] = [None, Some(10)].map(|keyframes| {
            let (heading, off_rad) = drive(400, 0.1, keyframes);
            assert!(off_rad.abs() < 2.0 * NOISE_RAD, "{off_rad} rad");
            heading.covariance[(1, 1)].sqrt()
        });
        // A map of ten keyframes follows the lean by 2/11 a scan.
        let floor_radps = LEAN_SIGMA_RAD * 2.0 / 11.0 / INTERVAL_S;
        assert!(
            driven > floor_radps && driven > 2.0 * stood,
            "{driven}, {stood} rad/s"
        );
    }

    #[test]
    fn the_place_moves_along_with_the_heading() {
        let config = GyroConfig::default();
        let mut heading = Heading::new(&GyroConfig {
            bias_sigma_radps: 0.0,
            ..config.clone()
        });
        let turn = GyroTurn {
            interval_s: INTERVAL_S,
            variance_rad2: 1e-12,
            ..GyroTurn::default()
        };
        // Along the axes of the scan before, which looks to the left.
        let previous = pose(0.0, 0.0, std::f64::consts::FRAC_PI_2);
        let covariance = Matrix3::new(1.0, 0.0, 0.5, 0.0, 1.0, 0.0, 0.5, 0.0, 1.0) * 1e-4;
        let registered = UncertainMotion {
            motion: pose(0.0, 2.0, previous.rotation.angle() + 0.01),
            covariance,
        };
        let predicted = heading.predict(&turn, &config);
        let fused = heading.weigh(&registered, &previous, &predicted, 1.0);
        let [x_m, y_m, yaw_rad] = xy_yaw(&fused.motion);
        let off = [x_m, y_m - 1.995, yaw_rad - previous.rotation.angle()];
        assert!(off.iter().all(|off| off.abs() < 1e-4), "{off:?}");
        assert!(fused.covariance[(2, 2)] < 2e-8 && fused.covariance[(0, 0)] < 0.8e-4);
    }
}
