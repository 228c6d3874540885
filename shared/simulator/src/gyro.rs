pub(crate) mod log;
#[cfg(test)]
mod tests;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

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
