//! The gyro: the section `[simulation.gyro]`.

use gyre_geometry::samples::UpAxis;
use serde::{Deserialize, Serialize};

use crate::{error::SimulatorError, limits::require_within};
use super::{GyroFigures, GyroProfile};

/// The gyro, its deviations from its profile, and its clock.
///
/// Figures are standard deviations: what a drive has is drawn from the seed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SimulatedGyroConfig {
    /// The gyro. Default: `none`, and then the other keys have no effect.
    pub profile: GyroProfile,
    /// The seed of its errors and of its clock. Default: the seed of the simulation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// The axis of the gyro that points up: `z`, `-z`, `x`, `-x`, `y` or `-y`. Otherwise its axes
    /// are forward and left.
    pub up: UpAxis,
    /// Samples a second. Default: the profile's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate_hz: Option<f64>,
    /// Angle random walk, rad/√s. Default: the profile's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_rad_per_sqrt_s: Option<f64>,
    /// Bias at switch-on, rad/s. Default: the profile's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bias_sigma_radps: Option<f64>,
    /// Change of the bias since switch-on, rad/s, after a time much longer than `bias_drift_s` (a
    /// Gauss-Markov process of first order). Default: the profile's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bias_drift_radps: Option<f64>,
    /// Time over which the bias changes, s. Default: the profile's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bias_drift_s: Option<f64>,
    /// Error of the scale of each axis, a share. Default: the profile's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale_sigma: Option<f64>,
    /// Angle about each axis by which it is mounted askew, rad. Default: the profile's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub misalignment_rad: Option<f64>,
    /// Step to which rates are rounded, rad/s; 0 for none. Default: the profile's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub step_radps: Option<f64>,
    /// Time by which stamps are late against the radar's, s.
    pub late_s: f64,
    /// Millionths by which its clock is fast against the radar's.
    pub clock_ppm: f64,
    /// Standard deviation of the stamps, s. They never go backwards.
    pub jitter_s: f64,
    /// Time between the stalls of its host, s, one in each such time; 0 for none.
    pub stall_every_s: f64,
    /// Duration of a stall, s: what is measured meanwhile is stamped at its end.
    pub stall_s: f64,
    /// Share of the samples that are lost.
    pub lost: f64,
}

impl SimulatedGyroConfig {
    /// Returns whether there is no gyro, and all keys are as configurations leave them out.
    pub(crate) fn is_default(&self) -> bool {
        *self == Self::default()
    }

    /// The figures of the gyro; `None` without one.
    pub fn figures(&self) -> Option<GyroFigures> {
        let figures = self.profile.figures()?;
        Some(GyroFigures {
            rate_hz: self.rate_hz.unwrap_or(figures.rate_hz),
            noise_rad_per_sqrt_s: self
                .noise_rad_per_sqrt_s
                .unwrap_or(figures.noise_rad_per_sqrt_s),
            bias_sigma_radps: self.bias_sigma_radps.unwrap_or(figures.bias_sigma_radps),
            bias_drift_radps: self.bias_drift_radps.unwrap_or(figures.bias_drift_radps),
            bias_drift_s: self.bias_drift_s.unwrap_or(figures.bias_drift_s),
            scale_sigma: self.scale_sigma.unwrap_or(figures.scale_sigma),
            misalignment_rad: self.misalignment_rad.unwrap_or(figures.misalignment_rad),
            step_radps: self.step_radps.unwrap_or(figures.step_radps),
        })
    }

    /// Checks that all values can be simulated.
    ///
    /// # Errors
    /// [`SimulatorError::Config`] with the key of the first value that cannot.
    pub fn validate(&self) -> Result<(), SimulatorError> {
        let given = |value: Option<f64>| value.unwrap_or(1e-3);
        require_within("gyro.rate_hz", self.rate_hz.unwrap_or(100.0), 1.0, 2000.0)?;
        let share = [
            (
                "gyro.noise_rad_per_sqrt_s",
                given(self.noise_rad_per_sqrt_s),
            ),
            ("gyro.bias_sigma_radps", given(self.bias_sigma_radps)),
            ("gyro.bias_drift_radps", given(self.bias_drift_radps)),
            ("gyro.scale_sigma", given(self.scale_sigma)),
            ("gyro.misalignment_rad", given(self.misalignment_rad)),
            ("gyro.step_radps", given(self.step_radps)),
            ("gyro.jitter_s", self.jitter_s),
            ("gyro.lost", self.lost),
        ];
        for (key, value) in share {
            require_within(key, value, 0.0, 1.0)?;
        }
        let drift_s = self.bias_drift_s.unwrap_or(1.0);
        require_within("gyro.bias_drift_s", drift_s, 0.1, 1e6)?;
        require_within("gyro.late_s", self.late_s, -1e6, 1e6)?;
        require_within("gyro.clock_ppm", self.clock_ppm, -1e5, 1e5)?;
        require_within("gyro.stall_every_s", self.stall_every_s, 0.0, 1e6)?;
        require_within("gyro.stall_s", self.stall_s, 0.0, self.stall_every_s)
    }
}
