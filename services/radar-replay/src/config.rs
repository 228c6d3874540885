//! The section `[source]`.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

/// What to play.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SourceConfig {
    /// The dataset's folder; `--data` on the command line. Default: none.
    pub data: PathBuf,
    /// The first scan to play. Default 0.
    pub first: usize,
    /// How many to play. Default: all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scans: Option<usize>,
}
