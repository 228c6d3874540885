//! The section `[source]`.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

/// The recording to play: section `[source]`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SourceConfig {
    /// Folder of the recording; `--data` on the command line.
    pub data: PathBuf,
    /// First scan to play, from 0.
    pub first: usize,
    /// Number of scans to play. Default: all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scans: Option<usize>,
}
