//! What to simulate.

use serde::{Deserialize, Serialize};

use crate::SimulatorError;
use crate::drive::DriveConfig;
use crate::sensor::SensorConfig;
use crate::town::TownConfig;
use crate::traffic::TrafficConfig;

/// What to simulate. Every key has a default, and unknown keys are refused.
///
/// One configuration gives one dataset, byte for byte (for one build on one kind of machine: sines and logarithms are the system's).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SimulationConfig {
    /// Scans to generate. Round a block the vehicle keeps circling as long as they last; where another drive ends, it stands.
    pub scans: usize,
    /// Where all randomness comes from: the town, the speckle, the noise.
    pub seed: u64,
    /// Which way the vehicle takes.
    pub drive: DriveConfig,
    /// What lines the streets.
    pub town: TownConfig,
    /// What moves besides.
    pub traffic: TrafficConfig,
    /// What measures.
    pub sensor: SensorConfig,
}

impl Default for SimulationConfig {
    fn default() -> Self {
        Self {
            scans: 64,
            seed: 1,
            drive: DriveConfig::default(),
            town: TownConfig::default(),
            traffic: TrafficConfig::default(),
            sensor: SensorConfig::default(),
        }
    }
}

impl SimulationConfig {
    /// Refuses what cannot be simulated, naming the key.
    pub fn validate(&self) -> Result<(), SimulatorError> {
        within("scans", self.scans as f64, 1.0, 100_000.0)?;
        self.drive.validate()?;
        self.town.validate()?;
        self.traffic.validate()?;
        self.sensor.validate()
    }
}

/// Refuses a value beyond its limits, naming its key.
pub(crate) fn within(key: &'static str, value: f64, least: f64, most: f64) -> Result<(), SimulatorError> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    Err(SimulatorError::Config { key, value: value.to_string(), expected: format!("between {least} and {most}") })
}
