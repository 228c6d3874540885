//! The buildings and other objects along the streets: the section `[simulation.town]`.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::error::SimulatorError;
use crate::limits::require_within;

/// The buildings and other objects along the streets.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TownConfig {
    /// The seed of the town: its streets and all that stands along them. Drives with the same seed,
    /// the same streets and otherwise the same section are in the same town. Default: the seed of
    /// the simulation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// The trajectories of all drives through the town, in any format that
    /// [`gyre_datasets::read_trajectory`] knows: streets are laid along all of them, whichever is
    /// driven. The world's frame is that of the first file's first pose. Default: streets along the
    /// drive alone.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub streets: Vec<PathBuf>,
    /// The seed of what changes from one drive to another while the town stays: which parking
    /// places are taken and by which cars, the leaves, the building sites. Default: as the seed of
    /// the town has them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub changes_seed: Option<u64>,
    /// The type of development.
    pub character: Character,
    /// Share of the parking places along kerbs and on car parks that are taken, 0 to 1.
    pub parked_cars: f64,
    /// Factor on the number of trees and bushes, 0 to 3.
    pub trees: f64,
    /// Share of the leaves that trees and bushes have, 0 (winter) to 1 (summer).
    pub leaves: f64,
    /// Share of the lots along streets that are building sites, 0 to 1.
    pub building_sites: f64,
    /// Share of the roadside, 0 to 1, that belts line: high stone walls and dense woods without
    /// gaps, which hide what is behind them. Default: 0, or as `simulation.realism` says.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub belts: Option<f64>,
    /// True if all streets are alike: their houses repeat every 216 m, in the same order on each
    /// street, so that places are hard to tell apart.
    pub look_alike: bool,
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
            seed: None,
            streets: Vec::new(),
            changes_seed: None,
            character: Character::Mixed,
            parked_cars: 0.5,
            trees: 1.0,
            leaves: 1.0,
            building_sites: 0.0,
            belts: None,
            look_alike: false,
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
        require_within("town.trees", self.trees, 0.0, 3.0)?;
        require_within("town.belts", self.belts.unwrap_or(0.0), 0.0, 1.0)?;
        require_within("town.leaves", self.leaves, 0.0, 1.0)?;
        require_within("town.building_sites", self.building_sites, 0.0, 1.0)
    }
}
