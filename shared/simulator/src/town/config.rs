//! What the town is like: the section `[simulation.town]`.

use serde::{Deserialize, Serialize};

use crate::error::SimulatorError;
use crate::limits::require_within;

/// What the town is like.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TownConfig {
    /// What lines the streets.
    pub character: Character,
    /// Share of the places along kerbs and on car parks that are taken, 0 to 1.
    pub parked_cars: f64,
    /// Factor on the number of trees and bushes, 0 to 3.
    pub trees: f64,
}

/// What lines the streets.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Character {
    /// All of the others by turns, some hundred metres each.
    #[default]
    Mixed,
    /// Closed facades close to the street.
    City,
    /// Detached houses in gardens.
    Suburb,
    /// Large buildings wide apart, with lawns, trees and car parks between.
    Campus,
    /// Hedges, fences and trees before open fields; a farm now and then.
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
    /// Refuses what cannot be built, naming the key.
    pub fn validate(&self) -> Result<(), SimulatorError> {
        require_within("town.parked_cars", self.parked_cars, 0.0, 1.0)?;
        require_within("town.trees", self.trees, 0.0, 3.0)
    }
}
