//! The likeness of a simulation to a real road: the key `simulation.realism`.

use serde::{Deserialize, Serialize};

/// The likeness of a simulation to a real road.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum Realism {
    /// A level town without belts, and a radar without faults.
    #[default]
    Plain,
    /// All effects of `[simulation.effects]` and `town.belts = 0.5` and `sensor.gain_db = 6`, where
    /// these are left out.
    Road,
}

impl Realism {
    /// Returns whether this is the default, which configurations leave out.
    pub(crate) fn is_plain(&self) -> bool {
        *self == Self::Plain
    }

    /// Share of the roadside that belts line. On a real road with it two methods disagree on drives
    /// along RADIATE's trajectories as they do on RADIATE's scans.
    pub(crate) fn belts(self) -> f64 {
        match self {
            Self::Plain => 0.0,
            Self::Road => 0.5,
        }
    }

    /// Decibels by which a radar is more sensitive than its profile: belts hide what the profiles
    /// were fitted with.
    pub(crate) fn gain_db(self) -> f64 {
        match self {
            Self::Plain => 0.0,
            Self::Road => 6.0,
        }
    }
}
