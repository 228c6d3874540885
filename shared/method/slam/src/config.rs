use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::{EstimatorKind, estimation::places::SUBMAP_REACH_M};

/// Configuration of SLAM: section `[slam]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
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
    /// Length of the path to each side of a keyframe whose keyframes make the submap of a loop, m,
    /// 0 to 50. A radar that turns slowly needs a longer path: three scans to each side.
    pub submap_reach_m: f64,
}

impl Default for SlamConfig {
    fn default() -> Self {
        Self {
            kind: SlamKind::default(),
            map: PathBuf::new(),
            submap_reach_m: SUBMAP_REACH_M,
        }
    }
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
}
