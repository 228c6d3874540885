//! The samples of a drive as a log has them, `imu.csv`: the motion of the vehicle (x forward, y
//! left, z up) with the errors of a gyro and of its clock.

use std::fmt::Write as _;

use gyre_geometry::samples::{Sample, SampleKind};
use nalgebra::{UnitQuaternion, Vector3};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::{GyroFigures, SimulatedGyroConfig};
use crate::{
    path::Path,
    stream::{Episodes, Stream},
};

pub(crate) const FILE: &str = "imu.csv";
/// The first row of the file, as in the log of RADIATE.
const HEADER: &str =
    "stamp_ns,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2";
const GRAVITY_MPS2: f64 = 9.806_65;
/// Steps of a log, of a rad/s and of a m/s².
const LOG_STEPS: [f64; 2] = [1e9, 1e6];
/// Time between two stamps while a host catches up, ns.
const CATCH_UP_NS: i64 = 100_000;
/// Time between stalls and their duration, s. Samples of a stall are stamped at its end.
const STALL_EVERY_S: f64 = 2.0;
const STALL_S: f64 = 0.06;
const LOST: f64 = 0.02;

/// The samples during a drive along a path, which starts at a time and lasts for a duration, by
/// their stamps: rates and accelerations in the gyro's own axes. `None` without a gyro.
pub(crate) fn samples(
    config: &SimulatedGyroConfig,
    seed: u64,
    path: &dyn Path,
    (start_ns, end_s): (i64, f64),
) -> Option<Vec<Sample>> {
    let figures = config.profile.figures()?;
    let mut errors = Errors::new(&figures, seed);
    let mut clock = Clock::new(config, seed);
    let sample = |index: usize| {
        let span_s = [index, index + 1].map(|index| index as f64 / figures.rate_hz);
        let values = errors.measure(&MeanMotion::along(path, span_s));
        let stamp_ns = clock.stamp_ns(0.5 * (span_s[0] + span_s[1]))?;
        Some(Sample {
            stamp_ns: start_ns + stamp_ns,
            kind: SampleKind::Gyro as u32,
            reserved: 0,
            values,
        })
    };
    let count = (end_s * figures.rate_hz).ceil() as usize;
    Some((0..count).filter_map(sample).collect())
}

pub(crate) fn csv(samples: &[Sample]) -> String {
    let mut text = format!("{HEADER}\n");
    for sample in samples {
        let _ = write!(text, "{}", sample.stamp_ns);
        for value in sample.values {
            let _ = write!(text, ",{value}");
        }
        text.push('\n');
    }
    text
}

/// The mean motion of the vehicle during a time, in its own axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct MeanMotion {
    pub rates_radps: Vector3<f64>,
    /// Acceleration as an accelerometer has it, with gravity: m/s².
    pub acceleration_mps2: Vector3<f64>,
}

impl MeanMotion {
    /// The mean motion along a path from one time to another, s. The rate is what turns the heading
    /// at the first into the one at the second, so that no rotation is lost.
    pub fn along(path: &dyn Path, [from_s, to_s]: [f64; 2]) -> Self {
        let duration_s = to_s - from_s;
        let [before, after] = [from_s, to_s].map(|time_s| path.pose(time_s).rotation);
        let turn_rad = before.rotation_to(&after).angle();
        let change = (path.velocity(to_s) - path.velocity(from_s)) / duration_s;
        let felt = path.pose(0.5 * (from_s + to_s)).rotation.inverse() * change;
        Self {
            rates_radps: Vector3::z() * (turn_rad / duration_s),
            acceleration_mps2: Vector3::new(felt.x, felt.y, GRAVITY_MPS2),
        }
    }
}

/// The errors of a gyro: noise, bias, scale, misalignment, steps.
pub(super) struct Errors {
    rng: ChaCha8Rng,
    step_radps: f64,
    /// Standard deviation of one sample, rad/s.
    noise_radps: f64,
    /// From the vehicle's axes to the axes of the gyro as mounted, up still up.
    mounting: UnitQuaternion<f64>,
    scale: Vector3<f64>,
    bias_radps: Vector3<f64>,
    /// Share of the drift that remains a sample later, and standard deviation of the added drift.
    kept: f64,
    new_drift_radps: f64,
    drift_radps: Vector3<f64>,
}

impl Errors {
    pub fn new(figures: &GyroFigures, seed: u64) -> Self {
        let mut rng = Stream::GYRO_ERRORS.generator(seed);
        let bias = normal(&mut rng);
        let scale = normal(&mut rng);
        let askew = normal(&mut rng);
        let kept = (-1.0 / (figures.rate_hz * figures.bias_drift_s)).exp();
        Self {
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
            let logged = vector.map(|value| {
                let steps = (value * LOG_STEPS[kind]).round();
                // Adding zero turns a negative one into a positive one.
                steps / LOG_STEPS[kind] + 0.0
            });
            values[3 * kind..][..3].copy_from_slice(logged.as_slice());
        }
        values
    }
}

fn normal(rng: &mut ChaCha8Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| rng.sample(StandardNormal))
}

/// The clock of a gyro: its offset, the stalls of its host, and lost samples.
pub(super) struct Clock<'a> {
    config: &'a SimulatedGyroConfig,
    rng: ChaCha8Rng,
    stalls: Episodes,
    last_ns: i64,
}

impl<'a> Clock<'a> {
    pub fn new(config: &'a SimulatedGyroConfig, seed: u64) -> Self {
        let stalls = Stream::GYRO_STALLS.generator(seed);
        Self {
            config,
            rng: Stream::GYRO_CLOCK.generator(seed),
            stalls: Episodes::new(STALL_EVERY_S, STALL_S, stalls),
            last_ns: i64::MIN + CATCH_UP_NS,
        }
    }

    /// Stamps a sample of a time of the drive, s: ns after the drive's start, or `None` if the host
    /// loses it.
    pub fn stamp_ns(&mut self, time_s: f64) -> Option<i64> {
        let is_lost = self.rng.random::<f64>() < LOST && self.config.faults;
        let stall_s = self.stalls.begin_s(time_s);
        let stall_s = stall_s.filter(|_| self.config.faults);
        let handled_s = stall_s.map_or(time_s, |begin_s| begin_s + STALL_S);
        let stamp_ns = ((handled_s + self.config.delay_s) * 1e9).round() as i64;
        if is_lost {
            return None;
        }
        self.last_ns = stamp_ns.max(self.last_ns + CATCH_UP_NS);
        Some(self.last_ns)
    }
}
