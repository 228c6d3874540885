//! The buildings and other objects along the streets: the section `[simulation.town]`.

use serde::{Deserialize, Serialize};

use crate::error::SimulatorError;
use crate::limits::require_within;

/// The buildings and other objects along the streets.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TownConfig {
    /// The type of development.
    pub character: Character,
    /// Share of the parking places along kerbs and on car parks that are taken, 0 to 1.
    pub parked_cars: f64,
    /// Factor on the number of trees and bushes, 0 to 3.
    pub trees: f64,
}

/// A type of development.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum Character {
    /// The other types in turn, each for some hundred metres.
    #[default]
    Mixed,
    /// Closed facades close to the street.
    City,
    /// Detached houses in gardens.
    Suburb,
    /// Large buildings far apart, with lawns, trees and car parks between.
    Campus,
    /// Hedges, fences and trees in front of open fields; a few farms.
    Country,
}

impl Default for TownConfig {
    fn default() -> Self {
        Self {
            character: Character::Mixed,
            parked_cars: 0.5,
            trees: 1.0,
        }
    }
}

impl TownConfig {
    /// Checks that all values can be simulated.
    ///
    /// # Errors
    /// [`SimulatorError::Config`] with the key of the first value that cannot.
    pub fn validate(&self) -> Result<(), SimulatorError> {
        require_within("town.parked_cars", self.parked_cars, 0.0, 1.0)?;
        require_within("town.trees", self.trees, 0.0, 3.0)
    }
}
