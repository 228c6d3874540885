use nalgebra::{UnitQuaternion, Vector3};
use rand_chacha::ChaCha8Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Device, Drift, Measure, normal, rounded};
use crate::{
    path::Path,
    stream::{Episodes, Stream},
};

/// Time between the stalls of the host and their duration, s; share of the samples that are lost.
const FAULTS: [f64; 3] = [2.0, 0.06, 0.02];
const GRAVITY_MPS2: f64 = 9.806_65;
/// Steps of a log, of a rad/s and of a m/s².
const LOG_STEPS: [f64; 2] = [1e9, 1e6];
/// Degrees in radians.
const DEG: f64 = std::f64::consts::PI / 180.0;
const HOUR_S: f64 = 3600.0;
/// Time over which the temperature wanders, s.
const TEMPERATURE_S: f64 = 600.0;

/// The gyro and its clock. Its axes are forward, left and up.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SimulatedGyroConfig {
    /// The gyro. Default: `none`, and then the other keys have no effect.
    pub profile: GyroProfile,
    /// Delay of the stamps against the radar's clock, seconds.
    pub delay_s: f64,
    /// True if its host stalls for 60 ms in each 2 s and loses 2 % of the samples.
    pub faults: bool,
}

/// A gyro.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum GyroProfile {
    /// No gyro, and no log.
    #[default]
    None,
    /// Without errors but those that other keys give it, 100 Hz.
    Exact,
    /// Bosch BMI088: consumer MEMS, as in drones and robots.
    Bmi088,
    /// ST ASM330LHH: automotive MEMS.
    Asm330lhh,
    /// Analog Devices ADIS16495: tactical MEMS.
    Adis16495,
}

/// The figures of a gyro by its data sheet; standard deviations unless stated otherwise, and where
/// they are "typical" ones. The temperature is assumed to change by 1 K over 10 minutes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GyroFigures {
    pub rate_hz: f64,
    /// Angle random walk, rad/√s.
    pub noise_rad_per_sqrt_s: f64,
    /// Bias at switch-on, rad/s.
    pub bias_sigma_radps: f64,
    /// Change of the bias since, rad/s, after a long time.
    pub bias_drift_radps: f64,
    /// Time over which the bias changes, s.
    pub bias_drift_s: f64,
    /// Error of the scale, a share.
    pub scale_sigma: f64,
    pub misalignment_rad: f64,
    /// Step of the rates, rad/s.
    pub step_radps: f64,
}

impl GyroProfile {
    pub fn figures(self) -> Option<GyroFigures> {
        match self {
            Self::None => None,
            Self::Exact => Some(EXACT),
            // After BST-BMI088-DS001: output noise 0.014 °/s/√Hz, zero-rate offset ±1 °/s and
            // ±0.015 °/s/K, cross axis ±1 %, sensitivity ±1 %, 16 bits for ±125 °/s. It has no bias
            // instability; Bosch's flyer states below 2 °/h.
            Self::Bmi088 => Some(GyroFigures {
                noise_rad_per_sqrt_s: 0.014 * DEG,
                bias_sigma_radps: DEG,
                bias_drift_radps: 0.015 * DEG,
                scale_sigma: 0.01,
                misalignment_rad: 0.01,
                step_radps: 125.0 / 32768.0 * DEG,
                ..EXACT
            }),
            // After DocID031239: rate noise 5 mdps/√Hz, bias instability 3 °/h, zero-rate level ±1
            // °/s and ±0.005 °/s/K, 4.37 mdps a step at ±125 °/s. Sensitivity as for the BMI088.
            Self::Asm330lhh => Some(GyroFigures {
                rate_hz: 104.0,
                noise_rad_per_sqrt_s: 0.005 * DEG,
                bias_sigma_radps: DEG,
                bias_drift_radps: 0.005 * DEG,
                scale_sigma: 0.01,
                misalignment_rad: 0.01,
                step_radps: 0.00437 * DEG,
                ..EXACT
            }),
            // After its data sheet: angle random walk 0.09 °/√h, in-run bias stability 0.8 °/h,
            // bias repeatability 0.07 °/s, sensitivity 0.2 %, axes to the frame 0.25°, 32 bits
            // whose upper half has steps of 0.00625 °/s. The bias is compensated for temperature.
            Self::Adis16495 => Some(GyroFigures {
                rate_hz: 200.0,
                noise_rad_per_sqrt_s: 0.09 * DEG / HOUR_S.sqrt(),
                bias_sigma_radps: 0.07 * DEG,
                bias_drift_radps: 0.8 * DEG / HOUR_S,
                scale_sigma: 0.002,
                misalignment_rad: 0.25 * DEG,
                step_radps: 0.00625 / 65536.0 * DEG,
                ..EXACT
            }),
        }
    }
}

const EXACT: GyroFigures = GyroFigures {
    rate_hz: 100.0,
    noise_rad_per_sqrt_s: 0.0,
    bias_sigma_radps: 0.0,
    bias_drift_radps: 0.0,
    bias_drift_s: TEMPERATURE_S,
    scale_sigma: 0.0,
    misalignment_rad: 0.0,
    step_radps: 0.0,
};

pub(crate) fn device<'a>(
    gyro: &SimulatedGyroConfig,
    seed: u64,
    path: &'a dyn Path,
) -> Option<Device<'a>> {
    let figures = gyro.profile.figures()?;
    let [every_s, lasts_s, lost] = if gyro.faults { FAULTS } else { [0.0; 3] };
    let mut errors = Stream::GYRO_ERRORS.generator(seed);
    let measure = figures.measure(&mut errors, |span_s| MeanMotion::along(path, span_s));
    let delay_s = gyro.delay_s;
    Some(Device {
        rate_hz: figures.rate_hz,
        stamped_at: 0.5,
        errors,
        host: Some(Stream::GYRO_CLOCK.generator(seed)),
        clock: Box::new(move |_, time_s| time_s + delay_s),
        lost: Some(lost),
        episodes: Episodes::new(every_s, lasts_s, Stream::GYRO_STALLS.generator(seed)),
        stalls: true,
        measure,
    })
}

/// The mean motion of the vehicle during a time, in its own axes.
#[derive(Clone, Copy, Debug)]
pub struct MeanMotion {
    pub rates_radps: Vector3<f64>,
    /// Acceleration as an accelerometer has it, with gravity: m/s².
    pub acceleration_mps2: Vector3<f64>,
}

impl MeanMotion {
    /// The mean motion along a path from one time to another, s. The rate is what turns the heading
    /// at the first into the one at the second, so that no rotation is lost.
    fn along(path: &dyn Path, [from_s, to_s]: [f64; 2]) -> Self {
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

impl GyroFigures {
    /// Draws bias, scale and misalignment of a drive, and returns what measures a motion: rates,
    /// then accelerations, in the gyro's axes, as a log writes them.
    pub fn measure<'a>(
        self,
        rng: &mut ChaCha8Rng,
        motion: impl Fn([f64; 2]) -> MeanMotion + 'a,
    ) -> Measure<'a> {
        let [bias, scale, askew] = [0; 3].map(|_| normal::<3>(rng));
        let noise_radps = self.noise_rad_per_sqrt_s * self.rate_hz.sqrt();
        // From the vehicle's axes to the axes of the gyro as mounted, up still up.
        let mounting = UnitQuaternion::from_scaled_axis(askew * self.misalignment_rad);
        let scale = Vector3::repeat(1.0) + scale * self.scale_sigma;
        let bias_radps = bias * self.bias_sigma_radps;
        let (sigma_radps, lasts_s) = (self.bias_drift_radps, self.bias_drift_s);
        let mut drift = Drift::new(sigma_radps, lasts_s, self.rate_hz, Vector3::zeros());
        Box::new(move |rng, span_s, _| {
            let motion = motion(span_s);
            let noise = normal::<3>(rng) * noise_radps;
            let drift_radps = drift.value;
            drift.step(rng);
            let rates = (mounting * motion.rates_radps).component_mul(&scale);
            let rates = rates + bias_radps + drift_radps + noise;
            let rates = rates.map(|rate| rounded(rate, self.step_radps));
            let accelerations = mounting * motion.acceleration_mps2;
            let mut values = [0.0; 6];
            for (kind, vector) in [rates, accelerations].into_iter().enumerate() {
                let step = LOG_STEPS[kind];
                // Adding zero turns a negative one into a positive one.
                let logged = vector.map(|value| (value * step).round() / step + 0.0);
                values[3 * kind..][..3].copy_from_slice(logged.as_slice());
            }
            Some(values)
        })
    }
}
