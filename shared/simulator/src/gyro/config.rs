//! The gyro: the section `[simulation.gyro]`.

use serde::{Deserialize, Serialize};

use super::profile::GyroProfile;
use crate::error::SimulatorError;
use crate::limits::require_within;

/// The gyro and its clock. Its axes are forward, left and up.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SimulatedGyroConfig {
    /// The gyro. Default: `none`, and then the other keys have no effect.
    pub profile: GyroProfile,
    /// Delay of the stamps against the radar's clock, seconds.
    pub delay_s: f64,
    /// True if its host stalls for 60 ms in each 2 s and loses 2 % of the samples.
    pub faults: bool,
}

impl SimulatedGyroConfig {
    /// Checks that all values can be simulated.
    pub fn validate(&self) -> Result<(), SimulatorError> {
        require_within("gyro.delay_s", self.delay_s, -1e6, 1e6)
    }
}
