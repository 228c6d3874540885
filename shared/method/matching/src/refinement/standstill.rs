//! Standstill: holds the pose of a standing vehicle, whose estimates jitter about one place.
//!
//! Estimates are compared with an anchor, at first one of them. If the estimates of a second are
//! within their noise of it, the vehicle stands: its pose is held, and the anchor becomes the mean
//! of the estimates. An estimate beyond the noise means that the vehicle has moved. The motion is
//! then the whole displacement from the held pose, so that nothing of a slow motion is lost. Only
//! reported poses are held: registration, prediction and the map continue with the estimates.

#[cfg(test)]
mod tests;

use gyre_geometry::{Pose, UncertainMotion, interpolate, xy_yaw};
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::Outcome;

/// Squared Mahalanobis distance from the anchor beyond which a standing vehicle has moved: four
/// standard deviations.
const LIMIT: f64 = 16.0;
/// The same before it stands: one estimate in nine is farther off.
const ARRIVAL_LIMIT: f64 = 6.0;
/// Degrees of freedom of a pose, the mean of that square.
const DEGREES_OF_FREEDOM: f64 = 3.0;
/// Time at the anchor after which the vehicle stands, s: four turns of a radar that turns four
/// times a second. At 0.3 m/s or more it is beyond the limit by then.
const MIN_TIME_S: f64 = 0.95;
/// The anchor is the mean of so many estimates at most; older ones fade.
const MEAN_SCANS: u32 = 16;
/// Number of scans whose jitter the mean covers; older ones fade.
const JITTER_SCANS: u32 = 64;
/// The covariance, which predicts the jitter, has the weight of this many scans.
const PRIOR_SCANS: f64 = 8.0;
/// Bounds how far jitter can widen the limit.
const MAX_JITTER: f64 = 4.0;

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Standstill {
    /// The last reported pose, in the first scan's frame.
    pub reported: Pose,
    /// An estimate, and the mean of those after it while the vehicle stands, in the first scan's
    /// frame.
    pub anchor: Pose,
    /// Number of estimates in that mean.
    pub scans: u32,
    /// Time since the first of them, s.
    pub time_s: f64,
    /// Mean squared jitter from scan to scan while the vehicle stood, relative to the covariances.
    pub jitter: f64,
    pub jitter_scans: u32,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Estimate {
    /// The pose in the first scan's frame, with the covariance of the motion from the scan before.
    pub pose: UncertainMotion,
    /// The covariance of the reported motion, whose heading may be another sensor's.
    pub covariance: Matrix3<f64>,
    pub previous: Pose,
    pub outcome: Outcome,
    /// Wheels, Doppler or the gyro measure a motion since the scan before.
    pub moves: bool,
    pub interval_s: f64,
}

impl Estimate {
    /// Returns the motion as estimated, of a vehicle that is not held.
    pub fn unheld(&self) -> Report {
        Report {
            motion: UncertainMotion {
                motion: self.previous.inv_mul(&self.pose.motion),
                covariance: self.covariance,
            },
            stationary: false,
        }
    }
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Report {
    pub motion: UncertainMotion,
    /// The vehicle stands: the motion is zero.
    pub stationary: bool,
}

impl Default for Standstill {
    /// A chain of motions starts at its first scan's pose. The vehicle stands until it is seen to
    /// move.
    fn default() -> Self {
        Self {
            reported: Pose::identity(),
            anchor: Pose::identity(),
            scans: 1,
            time_s: MIN_TIME_S,
            jitter: 1.0,
            jitter_scans: 0,
        }
    }
}

impl Standstill {
    pub fn stands(&self) -> bool {
        self.time_s >= MIN_TIME_S
    }

    pub(super) fn next(&mut self, estimate: &Estimate) -> Report {
        let before = *self;
        if self.is_left_by(estimate) {
            self.move_to(estimate.pose.motion);
        } else {
            self.stay(estimate);
        }
        let factor = match estimate.outcome {
            // Nobody has seen that the vehicle still stands.
            Outcome::Predicted => 1.0,
            Outcome::Refined | Outcome::Weak => self.covariance_factor(&before),
        };
        let covariance = estimate.covariance * factor;
        let motion = if self.stands() {
            Pose::identity()
        } else {
            self.reported = estimate.pose.motion;
            before.reported.inv_mul(&self.reported)
        };
        Report {
            motion: UncertainMotion { motion, covariance },
            stationary: self.stands(),
        }
    }

    /// Returns whether the vehicle is no longer at the anchor. A prediction cannot decide, and
    /// continues the previous state, unless another sensor measures a motion.
    fn is_left_by(&self, estimate: &Estimate) -> bool {
        match estimate.outcome {
            Outcome::Predicted => estimate.moves || !self.stands(),
            Outcome::Refined | Outcome::Weak => {
                let variance = 1.0 + 1.0 / f64::from(self.scans.min(MEAN_SCANS));
                squared_distance(&self.anchor, estimate)
                    .is_none_or(|squared| squared > self.limit() * variance)
            }
        }
    }

    /// The largest squared distance, in variances, by jitter alone.
    fn limit(&self) -> f64 {
        if self.stands() {
            self.standing_limit()
        } else {
            ARRIVAL_LIMIT
        }
    }

    fn standing_limit(&self) -> f64 {
        let scans = f64::from(self.jitter_scans);
        let jitter = (PRIOR_SCANS + scans * self.jitter) / (PRIOR_SCANS + scans);
        LIMIT * jitter.min(MAX_JITTER)
    }

    fn move_to(&mut self, pose: Pose) {
        self.anchor = pose;
        (self.scans, self.time_s) = (1, 0.0);
    }

    fn stay(&mut self, estimate: &Estimate) {
        let stood = self.stands();
        self.time_s += estimate.interval_s;
        if estimate.outcome == Outcome::Predicted {
            return;
        }
        if stood {
            self.scans = self.scans.saturating_add(1);
            let share = 1.0 / f64::from(self.scans.min(MEAN_SCANS));
            self.anchor = interpolate(&self.anchor, &estimate.pose.motion, share);
        }
        if self.stands()
            && let Some(squared) = squared_distance(&estimate.previous, estimate)
        {
            // The difference of two estimates has twice the variance of one.
            let jitter = squared / (2.0 * DEGREES_OF_FREEDOM);
            self.jitter_scans = JITTER_SCANS.min(self.jitter_scans.saturating_add(1));
            self.jitter += (jitter - self.jitter) / f64::from(self.jitter_scans);
        }
    }

    /// The variance of a reported motion relative to the estimate's.
    ///
    /// A motion can hide until it comes to the limit, whose variance per coordinate is `hidden`. If
    /// a vehicle has stood for n scans, it drives off in one of about n scans. The motion that ends
    /// a standstill takes in what had been hidden.
    fn covariance_factor(&self, before: &Self) -> f64 {
        let hidden = self.standing_limit() / DEGREES_OF_FREEDOM;
        if self.stands() {
            hidden / f64::from(self.scans)
        } else if before.stands() && before.scans > 1 {
            1.0 + hidden
        } else {
            1.0
        }
    }
}

/// Returns the squared Mahalanobis distance of an estimate from a pose with the same heading but
/// for noise; `None` without a proper covariance.
fn squared_distance(from: &Pose, estimate: &Estimate) -> Option<f64> {
    let apart = Vector3::from(xy_yaw(&from.inv_mul(&estimate.pose.motion)));
    let factor = estimate.pose.covariance.cholesky()?;
    Some(apart.dot(&factor.solve(&apart)))
}
