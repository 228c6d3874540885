use serde::{Deserialize, Serialize};
use thiserror::Error;

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
#[error("the map's {0}")]
pub struct OptionError(String);

impl MapOptions {
    pub fn validate(&self) -> Result<(), OptionError> {
        let within = |name: &str, value: f64, (least, most): (f64, f64), bounds: &str| {
            let refused = || OptionError(format!("{name} is {value}, but must be {bounds}"));
            let fits = (least..=most).contains(&value);
            fits.then_some(()).ok_or_else(refused)
        };
        within("cell_m", self.cell_m, (0.05, 5.0), "0.05 to 5")?;
        within("near_m", self.near_m, (0.0, 1000.0), "0 to 1000")?;
        let beyond = self.cell_m.max(self.near_m.next_up());
        let reach = (beyond, 2000.0 * self.cell_m);
        let bounds = "beyond near_m, and 1 to 2000 cells";
        within("reach_m", self.reach_m, reach, bounds)?;
        let half = (0.1, 1e4);
        within("half_weight_m", self.half_weight_m, half, "0.1 to 10000")?;
        within("bearing_deg", self.bearing_deg, (0.0, 5.0), "0 to 5")
    }
}
