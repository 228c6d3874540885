//! What the refinement can be told.

use serde::{Deserialize, Serialize};

use crate::config::{ConfigError, accept, positive};

/// Configuration of [`Refiner`](crate::Refiner): section `[refinement]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RefinementConfig {
    /// `none`: the search's motion is the result. `local-map`: it is refined against a map of the last keyframes.
    pub kind: RefinementKind,
    /// How many keyframes make the map; 1 compares with the last one alone.
    pub keyframes: usize,
    /// A scan becomes a keyframe so far from the last one, m ...
    pub keyframe_distance_m: f64,
    /// ... or so much turned, degrees.
    pub keyframe_angle_deg: f64,
    /// Metres a cell of the map; its blur has a standard deviation of one cell.
    pub cell_m: f64,
    /// The map reaches so far from its newest keyframe, m: the points' largest range and a little more.
    pub reach_m: f64,
    /// How many times coarser the map is on which the match begins.
    pub coarse: f64,
    /// Most the velocity of a vehicle changes in a second, m/s^2: a motion that changes it more is not believed.
    pub acceleration_mps2: f64,
    /// Most its yaw rate changes in a second, degrees/s^2.
    pub yaw_acceleration_degps2: f64,
    /// A match may lie so far off besides, m ...
    pub jitter_m: f64,
    /// ... and degrees.
    pub jitter_deg: f64,
    /// A match that overlaps the map by less than this share of what is usual is not believed.
    pub min_overlap: f64,
    /// A match is used, but its scan kept out of the map, where it overlaps the map by less than this share of what is usual, ...
    pub firm_overlap: f64,
    /// ... where its points weigh less than this share of what is usual, ...
    pub min_support: f64,
    /// ... or where the search says otherwise by more than this, m ...
    pub search_agrees_m: f64,
    /// ... or degrees.
    pub search_agrees_deg: f64,
    /// After so many scans in a row that matched nothing, the map begins anew.
    pub max_unmatched: u32,
    /// Covariance = this x mean weight of the points x mean squared residual x inverse information matrix ...
    pub variance_scale: f64,
    /// ... and this standard deviation of the heading besides, degrees: no antenna turns quite evenly.
    pub yaw_sigma_deg: f64,
}

/// What follows the search.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RefinementKind {
    /// Nothing.
    None,
    /// Registration against the local map.
    #[default]
    LocalMap,
}

impl Default for RefinementConfig {
    fn default() -> Self {
        Self {
            kind: RefinementKind::default(),
            keyframes: 10,
            keyframe_distance_m: 1.5,
            keyframe_angle_deg: 3.0,
            cell_m: 0.3,
            reach_m: 85.0,
            coarse: 3.0,
            acceleration_mps2: 6.0,
            yaw_acceleration_degps2: 90.0,
            jitter_m: 0.8,
            jitter_deg: 3.0,
            min_overlap: 0.5,
            firm_overlap: 0.7,
            search_agrees_m: 2.0,
            search_agrees_deg: 6.0,
            min_support: 0.6,
            max_unmatched: 5,
            variance_scale: 0.7,
            yaw_sigma_deg: 0.19,
        }
    }
}

impl RefinementConfig {
    /// Checks every value.
    ///
    /// # Errors
    /// The first key that no refinement can be built from.
    pub fn validate(&self) -> Result<(), ConfigError> {
        let check = |good, key, actual: &dyn ToString, expected| {
            accept(good, "refinement", key, actual, expected)
        };
        check(
            (1..=64).contains(&self.keyframes),
            "keyframes",
            &self.keyframes,
            "1 to 64",
        )?;
        check(
            (0.05..=10.0).contains(&self.cell_m),
            "cell_m",
            &self.cell_m,
            "metres, 0.05 to 10",
        )?;
        let cells = self.reach_m / self.cell_m;
        check(
            (8.0..=1000.0).contains(&cells),
            "reach_m",
            &self.reach_m,
            "8 to 1000 cells of cell_m",
        )?;
        check(
            (1.0..=8.0).contains(&self.coarse),
            "coarse",
            &self.coarse,
            "1 to 8",
        )?;
        let share = "a share, 0 to 1";
        check(
            (0.0..=1.0).contains(&self.min_overlap),
            "min_overlap",
            &self.min_overlap,
            share,
        )?;
        check(
            (0.0..=1.0).contains(&self.firm_overlap),
            "firm_overlap",
            &self.firm_overlap,
            share,
        )?;
        check(
            (0.0..=1.0).contains(&self.min_support),
            "min_support",
            &self.min_support,
            share,
        )?;
        for (key, value) in [
            ("keyframe_distance_m", self.keyframe_distance_m),
            ("keyframe_angle_deg", self.keyframe_angle_deg),
            ("acceleration_mps2", self.acceleration_mps2),
            ("yaw_acceleration_degps2", self.yaw_acceleration_degps2),
            ("search_agrees_m", self.search_agrees_m),
            ("search_agrees_deg", self.search_agrees_deg),
            ("jitter_m", self.jitter_m),
            ("jitter_deg", self.jitter_deg),
            ("variance_scale", self.variance_scale),
        ] {
            check(positive(value), key, &value, "a positive number")?;
        }
        check(
            (0.0..=90.0).contains(&self.yaw_sigma_deg),
            "yaw_sigma_deg",
            &self.yaw_sigma_deg,
            "0 to 90",
        )
    }
}
