//! The section `[source]`.

use std::path::PathBuf;

use gyre_radar::{AzimuthSource, DatasetOptions, Format};
use serde::{Deserialize, Serialize};

/// What to play. Keys that are left out take the defaults of the dataset's format.
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
    /// The form of files: see [`DatasetOptions::format`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub format: Option<Format>,
    /// Metres a range bin: see [`DatasetOptions::range_resolution_m`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range_resolution_m: Option<f32>,
    /// Metres to add to every range: see [`DatasetOptions::range_offset_m`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range_offset_m: Option<f32>,
    /// `encoder` or `uniform`: see [`DatasetOptions::azimuth_source`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub azimuth_source: Option<AzimuthSource>,
    /// Encoder counts a turn: see [`DatasetOptions::encoder_counts`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub encoder_counts: Option<u16>,
}

impl SourceConfig {
    /// How to read the dataset.
    pub fn options(&self) -> DatasetOptions {
        DatasetOptions {
            format: self.format,
            range_resolution_m: self.range_resolution_m,
            range_offset_m: self.range_offset_m,
            azimuth_source: self.azimuth_source,
            encoder_counts: self.encoder_counts,
        }
    }
}
