use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::error::SimulatorError;
use crate::path::recorded;
use crate::path::{BlockLoop, Path};

/// Lateral acceleration in the bends of a block, metres a second squared, which limits the speed.
const LATERAL_MPS2: f64 = 5.0;

/// The path of the vehicle: laps around a block of houses, or a recorded trajectory.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct DriveConfig {
    /// Length and width of the block from street centre to street centre, metres.
    pub block_m: [f64; 2],
    /// Speed on the straights of the block, metres a second.
    pub speed_mps: f64,
    /// A trajectory to drive along instead, in any format that `gyre evaluate` reads. Poses without
    /// times are one sweep apart.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// Start in the file, seconds after its first pose.
    pub from_s: f64,
}

impl Default for DriveConfig {
    fn default() -> Self {
        Self {
            block_m: [40.0, 32.0],
            speed_mps: 9.5,
            file: None,
            from_s: 0.0,
        }
    }
}

impl DriveConfig {
    /// Builds the path, for a radar with so many sweeps a second.
    pub fn path(&self, rate_hz: f64) -> Result<Box<dyn Path>, SimulatorError> {
        let [length_m, width_m] = self.block_m;
        let Some(file) = &self.file else {
            let block = BlockLoop::new(length_m, width_m, self.speed_mps, LATERAL_MPS2);
            return Ok(Box::new(block));
        };
        Ok(Box::new(recorded::read(file, self.from_s, rate_hz)?))
    }
}
