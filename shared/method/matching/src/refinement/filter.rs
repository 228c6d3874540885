//! One coordinate of the vehicle by another sensor and the radar together: an error-state Kalman
//! filter (Solà 2017, 5 to 7) over the coordinate, the drift of the radar, the bias and the scale
//! of the sensor, and the offset of an absolute heading. The coordinate is the heading, or the
//! place along the path.
//!
//! The radar measures it in the local map. A registration errs by white jitter, which the next
//! registration takes back, so that the errors of successive motions are correlated; and the map
//! drifts, a random walk (coloured noise as a further state: Bar-Shalom, Li, Kirubarajan, 8.3). The
//! sensor predicts it. The tracker and its map stay the radar's alone.

use gyre_geometry::{
    Pose,
    samples::{Evidence, GyroConfig, SensorConfig, SensorConfigs, Witness},
    wrap_angle,
};
use nalgebra::{Matrix5, RowVector5, Vector5};
use serde::{Deserialize, Serialize};

use super::Witnessed;

/// Square of what another sensor and the radar are apart, over its variance, beyond which one of
/// them is wrong: four standard deviations.
pub(super) const GATE: f64 = 16.0;
/// Random walk of the scale of wheels and Doppler, /√s: tyres that warm change it by 0.06 % in an
/// hour.
const SCALE_WALK_PER_SQRT_S: f64 = 1e-5;
/// Standard deviation of the offset of an absolute heading, rad: any angle.
const OFFSET_RAD: f64 = 2.0;
/// After so many refused headings in a row the offset is learnt again: the first one was wrong, or
/// a compass was moved.
const MAX_REFUSALS: u32 = 40;
/// Random walk of that offset, rad/√s: errors of a receiver or a compass that last.
const OFFSET_WALK_RAD_PER_SQRT_S: f64 = 3e-5;

/// The states, in the order of the covariance.
const VALUE: usize = 0;
const DRIFT: usize = 1;
const BIAS: usize = 2;
const SCALE: usize = 3;
const OFFSET: usize = 4;
/// The part that each has in a registered coordinate.
const SEEN: RowVector5<f64> = RowVector5::new(1.0, 1.0, 0.0, 0.0, 0.0);
/// The part that each has in a measured absolute heading.
const OBSERVED: RowVector5<f64> = RowVector5::new(1.0, 0.0, 0.0, 0.0, 1.0);

/// The coordinate, the drift of the map in it, and the bias and the scale of the sensor: rad for
/// the heading, m along the path.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Filter {
    /// The coordinate minus the coordinate of the tracker's pose in the map.
    pub correction: f64,
    /// The coordinate in the map minus the coordinate, but for jitter.
    pub drift: f64,
    /// Measured rate minus the true rate, per second.
    pub bias: f64,
    /// True change over the measured change, but for the bias.
    pub scale: f64,
    /// Measured absolute heading minus the heading, rad.
    pub offset_rad: f64,
    /// Covariance of the errors of coordinate, drift, bias, scale and offset.
    pub covariance: Matrix5<f64>,
    pub verdict: Verdict,
    /// The verdict on the absolute heading.
    pub offset_verdict: Verdict,
    /// Number of absolute headings in a row that were refused.
    pub refusals: u32,
    /// Correction and jitter at the last reported pose.
    pub reported: [f64; 2],
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Verdict {
    /// Noise can bring both so far apart.
    #[default]
    Agrees,
    /// Noise cannot, but a single match can err by so much.
    Doubted,
    /// The sensor is wrong, as wheels that slip: it is not used.
    Refused,
}

/// The errors that all measurements of a sensor share.
#[derive(Debug, Clone, Copy)]
pub(super) struct SharedErrors {
    bias: f64,
    bias_sigma: f64,
    bias_walk_per_sqrt_s: f64,
    scale_sigma: f64,
    scale_walk_per_sqrt_s: f64,
    /// The farthest that a learnt scale can be from 1.
    max_scale_error: f64,
}

impl SharedErrors {
    /// Returns the errors of each kind, in the order of [`Witness::ALL`].
    pub fn of(configs: &SensorConfigs) -> [Self; Witness::ALL.len()] {
        let of_distance = |scale_sigma: f64, max_scale_error: f64| Self {
            bias: 0.0,
            bias_sigma: 0.0,
            bias_walk_per_sqrt_s: 0.0,
            scale_sigma,
            scale_walk_per_sqrt_s: SCALE_WALK_PER_SQRT_S,
            max_scale_error,
        };
        let (wheels, doppler) = (&configs.wheels, &configs.doppler);
        Witness::ALL.map(|kind| match kind {
            Witness::Gyro => Self::of_gyro(&configs.gyro),
            Witness::Wheels => of_distance(wheels.scale_sigma, wheels.scale().1),
            // An absolute heading has no filter of its own.
            _ => of_distance(doppler.scale_sigma, doppler.max_scale_error()),
        })
    }

    pub fn of_gyro(config: &GyroConfig) -> Self {
        Self {
            bias: config.bias_radps,
            bias_sigma: config.bias_sigma_radps,
            bias_walk_per_sqrt_s: config.bias_walk_radps_per_sqrt_s,
            scale_sigma: config.scale_sigma,
            scale_walk_per_sqrt_s: 0.0,
            max_scale_error: config.max_scale_error(),
        }
    }
}

/// The prediction of the next scan by a sensor.
#[derive(Debug, Clone, Copy)]
pub(super) struct Predicted {
    /// The change since the scan before: rad or m.
    pub change: f64,
    /// From the tracker's pose to the predicted coordinate in the map.
    pub in_map: f64,
    pub measured: f64,
    pub interval_s: f64,
    /// The variance of the change that is of neither bias nor scale.
    pub noise: f64,
    bias_variance: f64,
    scale_variance: f64,
    /// The covariance of the filter at the scan, if the coordinate is the predicted one.
    covariance: Matrix5<f64>,
}

impl Predicted {
    /// Returns the variance of the change where the errors of bias and scale are common to all
    /// changes over a time, s, and a measured change, such that the variances of all changes add
    /// up: the squares of these errors grow with the squares of the time and of the change.
    pub fn variance_after(&self, [time_s, changed]: [f64; 2]) -> f64 {
        self.noise
            + self.bias_variance * grown(self.interval_s, time_s)
            + self.scale_variance * grown(self.measured, changed)
    }

    /// Returns the variance of the change where those errors count as new after a time, s, and a
    /// change: for covariances of motions, which are composed as if independent.
    pub fn variance_with(&self, [time_s, changed]: [f64; 2]) -> f64 {
        let (interval_s, change) = (self.interval_s, self.measured.abs());
        self.noise
            + self.bias_variance * interval_s * time_s.max(interval_s)
            + self.scale_variance * change * changed.max(change)
    }

    fn of_scale(&self) -> f64 {
        self.scale_variance * self.measured.powi(2)
    }
}

/// By how much the square of a sum grows with a step, at least by the square of the step.
pub(super) fn grown(step: f64, sum: f64) -> f64 {
    (step * (step + 2.0 * sum)).max(step * step)
}

/// A registered coordinate.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seen {
    /// From the tracker's last pose to the registered one.
    pub change: f64,
    /// The variance of its jitter: the motion between two registered poses has the jitter of both.
    pub jitter: f64,
    /// By how much the variance of the map's drift has grown since the last pose.
    pub drift: f64,
}

impl Filter {
    pub(super) fn new(errors: &SharedErrors) -> Self {
        let sigmas = Vector5::new(0.0, 0.0, errors.bias_sigma, errors.scale_sigma, OFFSET_RAD);
        Self {
            bias: errors.bias,
            scale: 1.0,
            covariance: Matrix5::from_diagonal(&sigmas.component_mul(&sigmas)),
            ..Self::default()
        }
    }

    pub(super) fn witnessed(&self, measured: f64, registered: f64) -> Witnessed {
        let sigma = |state| self.covariance[(state, state)].max(0.0).sqrt();
        Witnessed {
            verdict: self.verdict,
            measured,
            registered,
            scale: self.scale,
            scale_sigma: sigma(SCALE),
            bias: self.bias,
            bias_sigma: sigma(BIAS),
        }
    }

    /// Propagates bias, scale and offset over a time.
    pub(super) fn wait(&mut self, time_s: f64, errors: &SharedErrors) {
        let walks = [
            (BIAS, errors.bias_walk_per_sqrt_s),
            (SCALE, errors.scale_walk_per_sqrt_s),
            (OFFSET, OFFSET_WALK_RAD_PER_SQRT_S),
        ];
        for (state, walk) in walks {
            self.covariance[(state, state)] += walk.powi(2) * time_s;
        }
    }

    /// Predicts the coordinate of the next scan.
    pub(super) fn predict(&self, measured: &Evidence) -> Predicted {
        let (time_s, value) = (measured.interval_s, measured.value[0]);
        let noise = measured.covariance[0];
        let mut step = Matrix5::identity();
        (step[(VALUE, BIAS)], step[(VALUE, SCALE)]) = (-time_s, value);
        let mut covariance = step * self.covariance * step.transpose();
        covariance[(VALUE, VALUE)] += noise;
        let change = self.scale * value - self.bias * time_s;
        Predicted {
            change,
            in_map: change + self.jitter(),
            measured: value,
            interval_s: time_s,
            noise,
            bias_variance: covariance[(BIAS, BIAS)],
            scale_variance: covariance[(SCALE, SCALE)],
            covariance,
        }
    }

    /// The filter's coordinate in the map minus the coordinate of the tracker's pose.
    fn jitter(&self) -> f64 {
        self.correction + self.drift
    }

    /// Compares a registered coordinate with the predicted one, where single matches err by up to
    /// `gross_error`. A sensor that was refused is to agree by the scale that is known: a scale
    /// that is free to move would follow it.
    pub(super) fn gate(&self, seen: &Seen, predicted: &Predicted, gross_error: f64) -> Verdict {
        let apart = seen.change - predicted.in_map;
        let mut variance = (SEEN * predicted.covariance * SEEN.transpose())[0];
        if self.verdict == Verdict::Refused {
            variance -= predicted.of_scale();
        }
        if apart.powi(2) <= GATE * (variance + seen.jitter + seen.drift) {
            Verdict::Agrees
        } else if apart.abs() <= gross_error {
            Verdict::Doubted
        } else {
            Verdict::Refused
        }
    }

    /// Weighs a registered coordinate against the predicted one. Returns the variance that the
    /// reported motion has beside the sensor's: the error of earlier motions that the motion takes
    /// back.
    ///
    /// In doubt, either the match or the sensor has a gross error: the coordinate is the predicted
    /// one, and the next match decides.
    pub(super) fn update(&mut self, seen: &Seen, predicted: &Predicted) -> f64 {
        let apart = seen.change - predicted.in_map;
        self.covariance = predicted.covariance;
        self.covariance[(DRIFT, DRIFT)] += seen.drift;
        // The tracker's pose has moved to the registered coordinate.
        self.correction = -self.drift - apart;
        if self.verdict == Verdict::Doubted {
            return apart.powi(2);
        }
        let variance_before = self.covariance[(VALUE, VALUE)];
        self.correct_by(apart, &SEEN, seen.jitter);
        variance_before - self.covariance[(VALUE, VALUE)]
    }

    /// The update of the Kalman filter by a measurement that is `apart` from its prediction. The
    /// states have these parts in the measurement.
    fn correct_by(&mut self, apart: f64, parts: &RowVector5<f64>, variance: f64) {
        let across = self.covariance * parts.transpose();
        let gain = across / ((parts * across)[0] + variance);
        let step = gain * apart;
        self.correction += step[VALUE];
        self.drift += step[DRIFT];
        self.bias += step[BIAS];
        self.scale += step[SCALE];
        self.offset_rad += step[OFFSET];
        // Joseph's form stays symmetric and positive.
        let kept = Matrix5::identity() - gain * parts;
        self.covariance =
            kept * self.covariance * kept.transpose() + gain * gain.transpose() * variance;
    }

    /// Weighs a measured absolute heading against the heading of the tracker's pose, both in rad,
    /// unless both disagree.
    pub(super) fn observe(&mut self, measured: &Evidence, tracker_rad: f64) {
        let predicted_rad = tracker_rad + self.correction + self.offset_rad;
        let apart_rad = wrap_angle(measured.value[0] - predicted_rad);
        let variance = (OBSERVED * self.covariance * OBSERVED.transpose())[0];
        let noise = measured.covariance[0];
        self.offset_verdict = match apart_rad.powi(2) <= GATE * (variance + noise) {
            true => Verdict::Agrees,
            false => Verdict::Refused,
        };
        if self.offset_verdict == Verdict::Agrees {
            self.refusals = 0;
            self.correct_by(apart_rad, &OBSERVED, noise);
            return;
        }
        self.refusals += 1;
        if self.refusals == MAX_REFUSALS {
            self.free_offset();
        }
    }

    fn free_offset(&mut self) {
        self.refusals = 0;
        self.covariance.row_mut(OFFSET).fill(0.0);
        self.covariance.column_mut(OFFSET).fill(0.0);
        self.covariance[(OFFSET, OFFSET)] = OFFSET_RAD.powi(2);
    }

    /// Returns the verdict on an absolute heading, with the offset as its bias.
    pub(super) fn witnessed_heading(&self, measured_rad: f64) -> Witnessed {
        Witnessed {
            verdict: self.offset_verdict,
            measured: measured_rad,
            registered: 0.0,
            scale: 1.0,
            scale_sigma: 0.0,
            bias: wrap_angle(self.offset_rad),
            bias_sigma: self.covariance[(OFFSET, OFFSET)].max(0.0).sqrt(),
        }
    }

    /// Takes a registered coordinate. A sensor that disagrees with a certain match is refused. If
    /// all matches together imply an implausible scale, it has been wrong before, and its scale is
    /// learnt again.
    pub(super) fn judge(
        &mut self,
        seen: &Seen,
        predicted: Option<&Predicted>,
        is_certain: bool,
        errors: &SharedErrors,
    ) {
        match predicted {
            Some(predicted) if self.gate(seen, predicted, 0.0) == Verdict::Agrees => {
                self.verdict = Verdict::Agrees;
                self.update(seen, predicted);
                if !is_certain || self.is_plausible(errors) {
                    return;
                }
                *self = Self::new(errors);
                self.verdict = Verdict::Refused;
            }
            Some(_) if is_certain => self.verdict = Verdict::Refused,
            _ => {}
        }
        self.reset_to(seen);
    }

    /// Returns whether the sensor can have the learnt scale.
    pub(super) fn is_plausible(&self, errors: &SharedErrors) -> bool {
        (self.scale - 1.0).abs() <= errors.max_scale_error
    }

    /// Takes a registered coordinate whose change the sensor has not measured: the coordinate is
    /// the registered one but for the drift, and no doubt is left. Returns the variance that the
    /// reported motion has beside the registered one's: the error of a doubted change, which it
    /// takes back.
    pub(super) fn reset_to(&mut self, seen: &Seen) -> f64 {
        self.end_doubt();
        self.covariance[(DRIFT, DRIFT)] += seen.drift;
        self.tie(VALUE, DRIFT);
        self.covariance[(VALUE, VALUE)] += seen.jitter;
        self.correction = -self.drift;
        let taken_back = self.reported[1].powi(2);
        match taken_back > GATE * seen.jitter {
            true => taken_back,
            false => 0.0,
        }
    }

    /// Makes the error of one state the error of another state with the opposite sign.
    fn tie(&mut self, state: usize, to: usize) {
        let mut step = Matrix5::identity();
        (step[(state, state)], step[(state, to)]) = (0.0, -1.0);
        self.covariance = step * self.covariance * step.transpose();
    }

    /// Takes the predicted coordinate of a scan without a match. The tracker's pose has moved by
    /// `change`: to the filter's coordinate in the map, or not at all, without an anchor.
    pub(super) fn take_prediction(&mut self, change: f64, predicted: &Predicted) {
        self.covariance = predicted.covariance;
        self.correction = -self.drift - (change - predicted.in_map);
    }

    /// Takes the predicted coordinate of a scan whose registered coordinate is not determined by
    /// anything that stands still: the map follows the sensor. The tracker's pose has moved by
    /// `change`, with this variance of its jitter.
    pub(super) fn follow(&mut self, change: f64, jitter: f64, predicted: &Predicted) {
        self.take_prediction(change, predicted);
        self.tie(DRIFT, VALUE);
        self.covariance[(DRIFT, DRIFT)] += jitter;
        self.drift = -self.correction;
    }

    /// Takes a coordinate that neither the sensor nor the map has measured: one that is predicted
    /// from the motions before, with this variance.
    pub(super) fn inflate(&mut self, variance: f64) {
        self.covariance[(VALUE, VALUE)] += variance;
    }

    /// Returns a reported motion of the tracker with the heading of the filter.
    pub(super) fn correct(&mut self, motion: &Pose) -> Pose {
        let [correction_rad, jitter_rad] = self.reported;
        self.reported = [self.correction, self.jitter()];
        Pose::rotation(-jitter_rad)
            * motion
            * Pose::rotation(jitter_rad + self.correction - correction_rad)
    }

    /// A new map starts with the scan before: its error is the error of the coordinate. The
    /// tracker's pose has no jitter in it, and a match in it decides no doubt of before.
    pub(super) fn start_map(&mut self) {
        self.end_doubt();
        self.reported[1] -= self.jitter();
        self.tie(DRIFT, VALUE);
        self.drift = -self.correction;
    }

    fn end_doubt(&mut self) {
        if self.verdict == Verdict::Doubted {
            self.verdict = Verdict::Agrees;
        }
    }

    /// A new chain of motions starts with a new map, at a heading of its own.
    pub(super) fn start_chain(&mut self) {
        self.reported = [self.correction, 0.0];
        self.free_offset();
    }
}

#[cfg(test)]
mod tests;
