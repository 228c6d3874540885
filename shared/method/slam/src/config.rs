//! Configuration of SLAM.

use std::path::{Path, PathBuf};

use gyre_estimation::places::{PlaceOptionError, PlaceOptions};
use serde::{Deserialize, Serialize};

use crate::EstimatorKind;

/// Configuration of SLAM: section `[slam]`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SlamConfig {
    /// `none`: odometry alone. `filter` and `graph`: the keyframes of the drive are kept in
    /// `journal/keyframes.log`, for a correction of the trajectory by a filter or by a graph of
    /// their poses. Odometry is the same with all three.
    pub kind: SlamKind,
    /// Folder of a map of `gyre map`: the keyframes of the run are found in it while it drives, and
    /// published on the topic `fix`.
    #[serde(skip_serializing_if = "is_empty")]
    pub map: PathBuf,
    /// Keyframes, and the recognition and verification of places.
    pub places: PlaceOptions,
}

/// The correction of the trajectory by loops.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum SlamKind {
    /// Odometry alone.
    #[default]
    None,
    /// An extended Kalman filter over the poses of keyframes (Checchin et al.).
    Filter,
    /// A graph of the poses of all keyframes.
    Graph,
}

impl SlamKind {
    /// Returns the estimator of the trajectory; `None` for odometry alone.
    pub fn estimator(self) -> Option<EstimatorKind> {
        match self {
            Self::None => None,
            Self::Filter => Some(EstimatorKind::Filter),
            Self::Graph => Some(EstimatorKind::Graph),
        }
    }
}

fn is_empty(path: &Path) -> bool {
    path.as_os_str().is_empty()
}

impl SlamConfig {
    /// Returns whether the keyframes are found in a map.
    pub fn is_localised(&self) -> bool {
        self.is_on() && !is_empty(&self.map)
    }

    /// Returns whether keyframes are kept and loops closed.
    pub fn is_on(&self) -> bool {
        self.kind != SlamKind::None
    }

    pub fn validate(&self) -> Result<(), PlaceOptionError> {
        self.places.validate()
    }
}
