//! The errors of a gyro: noise, bias, scale, misalignment, steps.

use gyre_geometry::samples::UpAxis;
use nalgebra::{UnitQuaternion, Vector3};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use crate::stream::Stream;
use super::{GyroFigures, attitude::MeanMotion};

/// Steps of a log, of a rad/s and of a m/s².
const LOG_STEPS: [f64; 2] = [1e9, 1e6];

/// A gyro with the errors of one drive.
pub(super) struct Errors {
    rng: ChaCha8Rng,
    up: UpAxis,
    step_radps: f64,
    /// Standard deviation of one sample, rad/s.
    noise_radps: f64,
    /// From the vehicle's axes to those of the gyro as it is mounted, up still up.
    mounting: UnitQuaternion<f64>,
    scale: Vector3<f64>,
    bias_radps: Vector3<f64>,
    /// Share of the drift that is left a sample later, and standard deviation of what is new.
    kept: f64,
    new_drift_radps: f64,
    drift_radps: Vector3<f64>,
}

impl Errors {
    /// Draws the errors of a drive.
    pub fn new(figures: &GyroFigures, up: UpAxis, seed: u64) -> Self {
        let mut rng = Stream::GyroErrors.generator(seed);
        let bias = normal(&mut rng);
        let scale = normal(&mut rng);
        let askew = normal(&mut rng);
        let kept = (-1.0 / (figures.rate_hz * figures.bias_drift_s)).exp();
        Self {
            up,
            step_radps: figures.step_radps,
            noise_radps: figures.noise_rad_per_sqrt_s * figures.rate_hz.sqrt(),
            mounting: UnitQuaternion::from_scaled_axis(askew * figures.misalignment_rad),
            scale: Vector3::repeat(1.0) + scale * figures.scale_sigma,
            bias_radps: bias * figures.bias_sigma_radps,
            kept,
            new_drift_radps: figures.bias_drift_radps * (1.0 - kept * kept).sqrt(),
            drift_radps: Vector3::zeros(),
            rng,
        }
    }

    /// Measures the mean motion during the time of one sample: rates, then accelerations, in the
    /// gyro's axes, as a log writes them. Each call takes as many random numbers.
    pub fn measure(&mut self, motion: &MeanMotion) -> [f64; 6] {
        let noise = normal(&mut self.rng) * self.noise_radps;
        let new = normal(&mut self.rng) * self.new_drift_radps;
        let rates = (self.mounting * motion.rates_radps).component_mul(&self.scale);
        let rates = rates + self.bias_radps + self.drift_radps + noise;
        self.drift_radps = self.drift_radps * self.kept + new;
        let rates = rates.map(|rate| match self.step_radps > 0.0 {
            true => (rate / self.step_radps).round() * self.step_radps,
            false => rate,
        });
        let accelerations = self.mounting * motion.acceleration_mps2;
        let mut values = [0.0; 6];
        for (kind, vector) in [rates, accelerations].into_iter().enumerate() {
            let logged = in_axes(self.up, vector).map(|value| {
                let steps = (value * LOG_STEPS[kind]).round();
                // Adding zero turns a negative one into a positive one.
                steps / LOG_STEPS[kind] + 0.0
            });
            values[3 * kind..][..3].copy_from_slice(&logged);
        }
        values
    }
}

/// Three numbers of a standard normal distribution.
fn normal(rng: &mut ChaCha8Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| rng.sample(StandardNormal))
}

/// The components along the axes of a gyro of which `up` points up, of a vector along forward, left
/// and up.
pub(super) fn in_axes(up: UpAxis, vector: Vector3<f64>) -> [f64; 3] {
    let [x, y, z]: [f64; 3] = vector.into();
    match up {
        UpAxis::Z => [x, y, z],
        UpAxis::MinusZ => [x, -y, -z],
        UpAxis::X => [z, x, y],
        UpAxis::MinusX => [-z, y, x],
        UpAxis::Y => [y, z, x],
        UpAxis::MinusY => [x, -z, y],
    }
}
