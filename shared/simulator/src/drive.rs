//! Which way the vehicle takes: the section `[simulation.drive]`.

use serde::{Deserialize, Serialize};

use crate::SimulatorError;
use crate::config::within;
use crate::trajectory::{BlockLoop, Trajectory};

/// Which way the vehicle takes, and how fast.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DriveConfig {
    /// Length of the block that the vehicle circles, from street centre to street centre, metres along x.
    pub block_length_m: f64,
    /// Width of that block, metres along y.
    pub block_width_m: f64,
    /// Speed on straights, metres a second.
    pub speed_m_s: f64,
    /// Sideways acceleration at which bends are taken, metres a second squared: it sets the speed in them.
    pub lateral_acceleration_m_s2: f64,
}

impl Default for DriveConfig {
    fn default() -> Self {
        Self { block_length_m: 40.0, block_width_m: 32.0, speed_m_s: 9.5, lateral_acceleration_m_s2: 5.0 }
    }
}

impl DriveConfig {
    /// Refuses what cannot be driven, naming the key.
    pub fn validate(&self) -> Result<(), SimulatorError> {
        within("drive.block_length_m", self.block_length_m, 30.0, 400.0)?;
        within("drive.block_width_m", self.block_width_m, 30.0, 400.0)?;
        within("drive.speed_m_s", self.speed_m_s, 0.5, 40.0)?;
        within("drive.lateral_acceleration_m_s2", self.lateral_acceleration_m_s2, 0.1, 20.0)
    }

    /// The drive; all its randomness comes from `seed`.
    pub fn trajectory(&self, _seed: u64) -> Result<Box<dyn Trajectory>, SimulatorError> {
        Ok(Box::new(BlockLoop::new(
            self.block_length_m,
            self.block_width_m,
            self.speed_m_s,
            self.lateral_acceleration_m_s2,
        )))
    }
}
