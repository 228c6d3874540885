//! The heading by gyro and radar together: an error-state Kalman filter (Solà 2017, 5 to 7) over
//! the heading, the drift of the radar's heading, and the bias and the scale of the gyro.
//!
//! The radar measures the heading in the local map. A registration errs by white jitter, which the
//! next registration takes back, so that the errors of successive motions are correlated; and the
//! map drifts, a random walk over the distance (coloured noise as a further state: Bar-Shalom, Li,
//! Kirubarajan, 8.3). The gyro predicts the heading. The tracker and its map stay the radar's
//! alone; reported motions have the heading of the filter.

use gyre_geometry::{
    Pose, UncertainMotion,
    samples::{GyroConfig, GyroTurn},
    wrap_angle,
};
use nalgebra::{Matrix3, Matrix4, RowVector4, Vector4};
use serde::{Deserialize, Serialize};

use super::Witnessed;

/// Square of what gyro, wheels or Doppler and the radar are apart, over its variance, beyond which
/// one of them is wrong: four standard deviations.
pub(super) const GATE: f64 = 16.0;
/// Drift of the radar's heading, rad/√m: 0.03 degrees per square root of 100 m. The trajectories
/// hardly depend on it between 0.01 and 0.1 degrees.
const DRIFT_RAD_PER_SQRT_M: f64 = 5.2e-5;
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
const DRIFT: usize = 1;
const BIAS: usize = 2;
const SCALE: usize = 3;
/// The part that each has in a registered heading.
const SEEN: RowVector4<f64> = RowVector4::new(1.0, 1.0, 0.0, 0.0);

/// The heading, the drift of the map, and the bias and the scale of the gyro.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Heading {
    /// The heading minus the heading of the tracker's pose in the map, rad.
    pub correction_rad: f64,
    /// The heading in the map minus the heading, but for jitter, rad.
    pub drift_rad: f64,
    pub bias_radps: f64,
    /// True turn over the measured turn, but for the bias. A gyro with a scale that it cannot have
    /// ([`GyroConfig::allows_scale`]) is not used any more.
    pub scale: f64,
    /// Covariance of the errors of heading, drift, bias and scale.
    pub covariance: Matrix4<f64>,
    pub verdict: Verdict,
    /// Correction and jitter at the last reported pose, rad.
    pub reported_rad: [f64; 2],
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Verdict {
    /// Noise can bring both so far apart.
    #[default]
    Agrees,
    /// Noise cannot, but a single match can err by so much.
    Doubted,
    /// The gyro is wrong: it is not used.
    Refused,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct PredictedTurn {
    /// The turn by the gyro, rad.
    turn_rad: f64,
    /// From the tracker's pose to the predicted heading in the map, rad.
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
            + self.scale_variance * grown(self.turn_rad, angle_rad)
    }

    pub fn is_certain(&self) -> bool {
        self.turn_rad.powi(2) > GATE * self.variance_rad2
    }

    /// Returns the covariance of a registered motion, weighed with this turn. `drift_share` is the
    /// share of the covariance that accumulates; the error of the gyro accumulates whole.
    pub fn covariance(&self, registered: &Matrix3<f64>, drift_share: f64) -> Matrix3<f64> {
        let variance_rad2 = registered[(2, 2)];
        let less = variance_rad2.min(self.variance_rad2 / drift_share) - variance_rad2;
        let by_yaw = registered.column(2) / variance_rad2;
        registered + by_yaw * by_yaw.transpose() * less
    }

    /// The heading of a pose against the predicted one, rad. `previous` is the pose of the scan
    /// before.
    fn apart_rad(&self, pose: &Pose, previous: &Pose) -> f64 {
        let yaw_rad = pose.rotation.angle();
        wrap_angle(yaw_rad - previous.rotation.angle() - self.yaw_rad)
    }
}

/// By how much the square of a sum grows with a step, at least by the square of that.
pub(super) fn grown(step: f64, sum: f64) -> f64 {
    (step * (step + 2.0 * sum)).max(step * step)
}

/// The variance of the jitter of a registered heading, rad²: the motion between two of them has
/// the jitter of both.
fn jitter_rad2(registered: &UncertainMotion) -> f64 {
    0.5 * registered.covariance[(2, 2)]
}

impl Heading {
    pub(super) fn new(config: &GyroConfig) -> Self {
        let [bias, scale] = [config.bias_sigma_radps, config.scale_sigma].map(|it| it * it);
        Self {
            bias_radps: config.bias_radps,
            scale: 1.0,
            covariance: Matrix4::from_diagonal(&Vector4::new(0.0, 0.0, bias, scale)),
            ..Self::default()
        }
    }

    pub(super) fn witnessed(&self, measured: f64) -> Witnessed {
        let sigma = |state| self.covariance[(state, state)].max(0.0).sqrt();
        Witnessed {
            verdict: self.verdict,
            measured,
            scale: self.scale,
            scale_sigma: sigma(SCALE),
            bias: self.bias_radps,
            bias_sigma: sigma(BIAS),
        }
    }

    /// Predicts the next heading by the gyro.
    pub(super) fn predict(&mut self, turn: &GyroTurn, config: &GyroConfig) -> PredictedTurn {
        let time_s = turn.interval_s;
        let noise_rad2 = turn.variance_rad2 + TILT_RAD_PER_SQRT_S.powi(2) * time_s;
        let mut step = Matrix4::identity();
        (step[(HEADING, BIAS)], step[(HEADING, SCALE)]) = (-time_s, turn.yaw_rad);
        self.covariance = step * self.covariance * step.transpose();
        self.covariance[(HEADING, HEADING)] += noise_rad2;
        self.propagate(time_s, config);
        let bias_radps2 = self.covariance[(BIAS, BIAS)];
        let scale_variance = self.covariance[(SCALE, SCALE)];
        let angle_rad = turn.yaw_rad.abs();
        let turn_rad = self.scale * turn.yaw_rad - self.bias_radps * time_s;
        PredictedTurn {
            turn_rad,
            yaw_rad: turn_rad + self.jitter_rad(),
            variance_rad2: noise_rad2
                + bias_radps2 * time_s * BIAS_TIME_S.max(time_s)
                + scale_variance * angle_rad * SCALE_TURN_RAD.max(angle_rad),
            sweep_rate_radps: self.scale * turn.sweep_rate_radps - self.bias_radps,
            noise_rad2,
            bias_radps2,
            scale_variance,
            interval_s: time_s,
        }
    }

    /// Propagates the bias over a time.
    pub(super) fn propagate(&mut self, time_s: f64, config: &GyroConfig) {
        self.covariance[(BIAS, BIAS)] += config.bias_walk_radps_per_sqrt_s.powi(2) * time_s;
    }

    /// The filter's heading in the map minus the heading of the tracker's pose.
    fn jitter_rad(&self) -> f64 {
        self.correction_rad + self.drift_rad
    }

    /// Propagates the drift of the map to a registered pose.
    fn drift(&mut self, registered: &UncertainMotion, previous: &Pose) {
        let shift = registered.motion.translation.vector - previous.translation.vector;
        self.covariance[(DRIFT, DRIFT)] += DRIFT_RAD_PER_SQRT_M.powi(2) * shift.norm();
    }

    /// Takes the heading of a registered pose whose turn the gyro has not measured: the heading is
    /// the registered one but for the drift, and no doubt is left. Returns the variance that the
    /// reported motion has beside the registered one's, rad²: the error of a doubted turn, which it
    /// takes back.
    pub(super) fn reset_to(&mut self, registered: &UncertainMotion, previous: &Pose) -> f64 {
        self.end_doubt();
        self.drift(registered, previous);
        let mut step = Matrix4::identity();
        (step[(HEADING, HEADING)], step[(HEADING, DRIFT)]) = (0.0, -1.0);
        self.covariance = step * self.covariance * step.transpose();
        let jitter_rad2 = jitter_rad2(registered);
        self.covariance[(HEADING, HEADING)] += jitter_rad2;
        self.correction_rad = -self.drift_rad;
        let taken_back_rad2 = self.reported_rad[1].powi(2);
        match taken_back_rad2 > GATE * jitter_rad2 {
            true => taken_back_rad2,
            false => 0.0,
        }
    }

    /// Takes the predicted heading of a scan without a match. The tracker's pose, `predicted`, has
    /// the filter's heading in the map, or has not turned: without an anchor.
    pub(super) fn take_prediction(
        &mut self,
        predicted: &Pose,
        previous: &Pose,
        turn: &PredictedTurn,
    ) {
        self.correction_rad = -self.drift_rad - turn.apart_rad(predicted, previous);
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
        let apart_rad = turn.apart_rad(&registered.motion, previous);
        let variance_rad2 = (SEEN * self.covariance * SEEN.transpose())[0];
        if apart_rad.powi(2) <= GATE * (variance_rad2 + jitter_rad2(registered)) {
            Verdict::Agrees
        } else if apart_rad.abs() <= jitter_rad {
            Verdict::Doubted
        } else {
            Verdict::Refused
        }
    }

    /// Weighs the heading of a registered pose against the predicted one. `previous` is the pose of
    /// the scan before. Returns the variance that the reported motion has beside the gyro's, rad²:
    /// the error of earlier motions that the motion takes back.
    ///
    /// In doubt, either the match or the gyro has a gross error: the heading is the predicted one,
    /// and the next match decides.
    pub(super) fn update(
        &mut self,
        registered: &UncertainMotion,
        previous: &Pose,
        turn: &PredictedTurn,
    ) -> f64 {
        self.drift(registered, previous);
        let apart_rad = turn.apart_rad(&registered.motion, previous);
        // The tracker's pose has moved to the registered heading.
        self.correction_rad = -self.drift_rad - apart_rad;
        if self.verdict == Verdict::Doubted {
            return apart_rad.powi(2);
        }
        let jitter_rad2 = jitter_rad2(registered);
        let variance_before = self.covariance[(HEADING, HEADING)];
        let across = self.covariance * SEEN.transpose();
        let gain = across / ((SEEN * across)[0] + jitter_rad2);
        let step = gain * apart_rad;
        self.correction_rad += step[HEADING];
        self.drift_rad += step[DRIFT];
        self.bias_radps += step[BIAS];
        self.scale += step[SCALE];
        // Joseph's form stays symmetric and positive.
        let kept = Matrix4::identity() - gain * SEEN;
        self.covariance =
            kept * self.covariance * kept.transpose() + gain * gain.transpose() * jitter_rad2;
        variance_before - self.covariance[(HEADING, HEADING)]
    }

    /// Returns a reported motion of the tracker with the heading of the filter.
    pub(super) fn correct(&mut self, motion: &Pose) -> Pose {
        let [correction_rad, jitter_rad] = self.reported_rad;
        self.reported_rad = [self.correction_rad, self.jitter_rad()];
        Pose::rotation(-jitter_rad)
            * motion
            * Pose::rotation(jitter_rad + self.correction_rad - correction_rad)
    }

    /// A new map starts with the scan before: its error is the error of the heading. The tracker's
    /// pose has no jitter in it, and a match in it decides no doubt of before.
    pub(super) fn start_map(&mut self) {
        self.end_doubt();
        self.reported_rad[1] -= self.jitter_rad();
        let mut step = Matrix4::identity();
        (step[(DRIFT, DRIFT)], step[(DRIFT, HEADING)]) = (0.0, -1.0);
        self.covariance = step * self.covariance * step.transpose();
        self.drift_rad = -self.correction_rad;
    }

    fn end_doubt(&mut self) {
        if self.verdict == Verdict::Doubted {
            self.verdict = Verdict::Agrees;
        }
    }

    /// A new chain of motions starts with a new map.
    pub(super) fn start_chain(&mut self) {
        self.reported_rad = [self.correction_rad, 0.0];
    }
}

#[cfg(test)]
mod tests;
