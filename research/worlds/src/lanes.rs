//! The lanes of a street.

use serde::{Deserialize, Serialize};

/// Width of a lane, metres: a vehicle drives half of it beside the centre line of its street.
pub const LANE_M: f64 = 3.2;

/// The side of the road on which vehicles drive.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "lowercase")]
pub enum DrivingSide {
    /// As in Britain, where Oxford's and RADIATE's recordings were made.
    #[default]
    Left,
    /// As in most other countries.
    Right,
}
