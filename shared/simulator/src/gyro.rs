pub(crate) mod log;
pub mod profile;
#[cfg(test)]
mod tests;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use profile::{GyroFigures, GyroProfile};

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
