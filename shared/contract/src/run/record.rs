//! The section `[record]`.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

/// The section `[record]`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RecordConfig {
    /// The file of the run's recording, `NAME.mcap`; `--record` on the command line. Default: none.
    #[serde(skip_serializing_if = "crate::run::unset::is_default")]
    pub file: PathBuf,
    /// The topics that are recorded: `scan`, `masked`, `rotation`, `motion`, `refined`, `pose`,
    /// `loop`, `correction`, `fix`, `log`, `health`. Default: all of these in the run except
    /// `masked` and `rotation`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub topics: Vec<String>,
    /// Size of a file before the recording continues in the next file, MB (rosbag2:
    /// `max_bagfile_size`, in bytes); 0: any.
    #[serde(skip_serializing_if = "crate::run::unset::is_default")]
    pub split_mb: u64,
    /// Time of the sensor before the recording continues in the next file, s (rosbag2:
    /// `max_bagfile_duration`); 0: any.
    #[serde(skip_serializing_if = "crate::run::unset::is_default")]
    pub split_s: f64,
    /// Size of all files of the recording before its oldest file is removed, MB; 0: any. It needs
    /// `split_mb` or `split_s`.
    #[serde(skip_serializing_if = "crate::run::unset::is_default")]
    pub keep_mb: u64,
    /// Age of a file of the recording, since it was complete, before it is removed, s; 0: any. It
    /// needs `split_mb` or `split_s`.
    #[serde(skip_serializing_if = "crate::run::unset::is_default")]
    pub keep_s: f64,
}

impl RecordConfig {
    /// Returns whether the run is recorded.
    pub fn is_on(&self) -> bool {
        !self.file.as_os_str().is_empty()
    }

    /// Returns whether old files are to be removed, but there is only one file.
    pub fn keeps_whole(&self) -> bool {
        let is_split = self.split_mb > 0 || self.split_s > 0.0;
        let is_limited = self.keep_mb > 0 || self.keep_s > 0.0;
        is_limited && !is_split
    }
}
