//! The density of traffic: the section `[simulation.traffic]`.

use serde::{Deserialize, Serialize};

use crate::error::SimulatorError;
use crate::limits::require_within;

/// The density of traffic.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TrafficConfig {
    /// The seed of the other road users. Default: the seed of the simulation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// Motor vehicles on a kilometre of each lane; 0 for none, not even in side streets.
    pub vehicles_per_km: f64,
    /// Relative spread of their speeds, by which gaps and paces vary.
    pub speed_spread: f64,
    /// Cyclists that the ego vehicle overtakes, for each kilometre.
    pub cyclists_per_km: f64,
    /// Pedestrians on the pavements, for each kilometre.
    pub pedestrians_per_km: f64,
}

impl Default for TrafficConfig {
    fn default() -> Self {
        Self {
            seed: None,
            vehicles_per_km: 20.0,
            speed_spread: 0.3,
            cyclists_per_km: 3.0,
            pedestrians_per_km: 25.0,
        }
    }
}

impl TrafficConfig {
    /// No traffic.
    pub fn none() -> Self {
        Self {
            vehicles_per_km: 0.0,
            cyclists_per_km: 0.0,
            pedestrians_per_km: 0.0,
            ..Self::default()
        }
    }

    /// Checks that all values can be simulated.
    ///
    /// # Errors
    /// [`SimulatorError::Config`] with the key of the first value that cannot.
    pub fn validate(&self) -> Result<(), SimulatorError> {
        require_within("traffic.vehicles_per_km", self.vehicles_per_km, 0.0, 80.0)?;
        require_within("traffic.speed_spread", self.speed_spread, 0.0, 0.8)?;
        require_within("traffic.cyclists_per_km", self.cyclists_per_km, 0.0, 50.0)?;
        require_within(
            "traffic.pedestrians_per_km",
            self.pedestrians_per_km,
            0.0,
            500.0,
        )
    }
}
