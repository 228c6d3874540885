//! The options of the bridge, and of the map that it publishes.

use std::path::{Path, PathBuf};

use gyre_ros2_messages::{Domain, Vehicle};
use gyre_slam::{EstimatorKind, mapping::MapOptions};

#[derive(Clone, Debug)]
pub struct Settings {
    pub out: PathBuf,
    pub domain: Domain,
    /// The namespace of the node and of its own topics, such as `/` or `/robot`.
    pub namespace: String,
    /// The name of the node.
    pub name: String,
    pub vehicle: Vehicle,
    /// True to publish `odom` -> `base_link` and `map` -> `odom`: only one program may.
    pub transforms: bool,
    /// Stamp of the transform `map` -> `odom` minus the stamp of its pose, ns.
    pub ahead_ns: i64,
    pub map: bool,
    /// True to publish the time of a replay.
    pub clock: bool,
    /// True for a managed node, which publishes only while it is active.
    pub is_managed: bool,
    /// Takes sentences for the terminal.
    pub say: fn(&str),
    /// Reads the settings of the run in a folder.
    pub of_run: fn(&Path) -> Result<RunSettings, String>,
}

/// The settings of a run that the bridge needs.
#[derive(Clone, Debug, PartialEq)]
pub struct RunSettings {
    /// `None` without SLAM.
    pub map: Option<MapSettings>,
    pub has_doppler: bool,
    /// True if the run predicts the poses between its scans.
    pub predicts: bool,
    /// True if the run plays a recording or a simulation, not a radar.
    pub is_replay: bool,
    /// The topics of ROS 2 with the samples of its other sensors.
    pub sensor_topics: Vec<String>,
}

#[derive(Clone, Debug, PartialEq)]
pub struct MapSettings {
    pub options: MapOptions,
    pub estimator: EstimatorKind,
}
