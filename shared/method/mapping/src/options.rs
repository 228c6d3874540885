//! Options of a map.

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// The options that a map is drawn with. It is stored with the map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MapOptions {
    pub cell_m: f64,
    /// Range of the nearest returns, m: nothing nearer was looked at.
    pub near_m: f64,
    /// The longest range that a keyframe sees, m.
    pub reach_m: f64,
    /// Range where a view has half the weight of a view from nearby, m.
    pub half_weight_m: f64,
    /// Standard deviation of the bearing of a return, degrees: a return is spread along its arc by
    /// so much.
    pub bearing_deg: f64,
}

impl Default for MapOptions {
    fn default() -> Self {
        Self {
            cell_m: 0.2,
            near_m: 5.0,
            reach_m: 80.0,
            half_weight_m: 30.0,
            bearing_deg: 0.4,
        }
    }
}

#[derive(Clone, Debug, PartialEq, Error)]
#[error("the map's {name} is {value}, but must be {bounds}")]
pub struct OptionError {
    pub name: &'static str,
    pub value: f64,
    pub bounds: &'static str,
}

impl MapOptions {
    pub fn validate(&self) -> Result<(), OptionError> {
        let option = |fits: bool, name, value, bounds| match fits {
            true => Ok(()),
            false => Err(OptionError {
                name,
                value,
                bounds,
            }),
        };
        let fits = (0.05..=5.0).contains(&self.cell_m);
        option(fits, "cell_m", self.cell_m, "0.05 to 5")?;
        let fits = (0.0..=1000.0).contains(&self.near_m);
        option(fits, "near_m", self.near_m, "0 to 1000")?;
        let fits = self.reach_m > self.near_m
            && (self.cell_m..=2000.0 * self.cell_m).contains(&self.reach_m);
        option(
            fits,
            "reach_m",
            self.reach_m,
            "beyond near_m, and 1 to 2000 cells",
        )?;
        let fits = (0.1..=1e4).contains(&self.half_weight_m);
        option(fits, "half_weight_m", self.half_weight_m, "0.1 to 10000")?;
        let fits = (0.0..=5.0).contains(&self.bearing_deg);
        option(fits, "bearing_deg", self.bearing_deg, "0 to 5")
    }
}
