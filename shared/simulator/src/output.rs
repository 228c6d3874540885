use std::fmt;
use std::str::FromStr;

use gyre_datasets::Format;
use schemars::JsonSchema;
use serde::de::{IntoDeserializer, value};
use serde::{Deserialize, Serialize};

/// The format of the dataset.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct OutputConfig {
    /// Format of the files. Default: in a run that of `dataset.format`, else Oxford's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub format: Option<OutputFormat>,
}

/// A dataset format that can be written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum OutputFormat {
    /// Oxford Radar RobotCar. Fits every radar.
    #[default]
    Oxford,
    /// Boreas, and Boreas Road Trip where the chirps alternate. Fits every radar.
    Boreas,
    /// RADIATE: transposed images without metadata. Fits radars that turn four times a second and
    /// whose first azimuth is straight ahead.
    Radiate,
}

impl fmt::Display for OutputFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

impl FromStr for OutputFormat {
    type Err = value::Error;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        Self::deserialize(name.into_deserializer())
    }
}

impl OutputFormat {
    /// The format that is read as `format`, if it can be written.
    pub fn read_as(format: Format) -> Option<Self> {
        match format {
            Format::Oxford => Some(Self::Oxford),
            Format::Boreas | Format::BoreasRt => Some(Self::Boreas),
            Format::Radiate => Some(Self::Radiate),
            _ => None,
        }
    }
}
