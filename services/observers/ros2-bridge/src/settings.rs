//! The options of the bridge, and of the map that it publishes.

use std::path::{Path, PathBuf};

use gyre_ros2_messages::{Domain, Vehicle};
use gyre_slam::{EstimatorKind, mapping::MapOptions};

#[derive(Clone, Debug)]
pub struct Settings {
    pub out: PathBuf,
    pub domain: Domain,
    /// The namespace of `odom`, `map` and the objects, such as `/` or `/robot`.
    pub namespace: String,
    pub vehicle: Vehicle,
    /// True to publish `odom` -> `base_link` and `map` -> `odom`: only one program may.
    pub transforms: bool,
    /// The settings of the map of a run with SLAM; `None`: no map.
    pub map: Option<MapSettingsOf>,
}

pub type MapSettingsOf = fn(&Path) -> Result<MapSettings, String>;

#[derive(Clone, Debug, PartialEq)]
pub struct MapSettings {
    pub options: MapOptions,
    pub estimator: EstimatorKind,
}
