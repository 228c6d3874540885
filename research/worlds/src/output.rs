//! The form of the dataset.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use gyre_simulator::OutputFormat;

/// The format of the dataset, and the times that its host logs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct OutputConfig {
    /// Format of the files. Default: Oxford's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub format: Option<OutputFormat>,
    /// The times at which the host receives scans, which RADIATE logs instead of the sensor's
    /// times.
    pub host_stamps: HostStamps,
}

/// The delays with which a host receives scans.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum HostStamps {
    /// The same delay for each scan.
    #[default]
    Even,
    /// About once in 64 scans the host stalls for up to 1.4 s and then catches up, as in RADIATE's
    /// recordings.
    Stalling,
}
