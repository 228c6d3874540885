//! In which form the scans come out: the section `[simulation.output]`.

use std::fmt;
use std::str::FromStr;

use gyre_radar::Format;
use serde::{Deserialize, Serialize};

/// In which form the scans come out.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OutputConfig {
    /// Whose form of files. Default: in a configuration that of `dataset.format`, else Oxford's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub format: Option<OutputFormat>,
    /// The times at which the host receives scans, which RADIATE logs instead of the sensor's.
    pub host_stamps: HostStamps,
    /// `gyre run` writes the recording to its results and plays it from there. Default: it plays without touching the disk.
    pub store: bool,
}

/// Whose form of files.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum OutputFormat {
    /// Oxford Radar RobotCar. Fits every radar.
    #[default]
    Oxford,
    /// Boreas, and Boreas Road Trip where the chirps alternate. Fits every radar.
    Boreas,
    /// RADIATE: images on their side, without metadata. Fits radars that turn four times a second and begin straight ahead.
    Radiate,
}

impl fmt::Display for OutputFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for OutputFormat {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let known = || Self::ALL.map(Self::name).join(", ");
        Self::ALL
            .into_iter()
            .find(|format| format.name() == name)
            .ok_or_else(|| format!("it is one of {}", known()))
    }
}

impl OutputFormat {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Oxford, Self::Boreas, Self::Radiate];

    /// The name in configurations and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Oxford => "oxford",
            Self::Boreas => "boreas",
            Self::Radiate => "radiate",
        }
    }

    /// The one that is read as `format`; `None` where there is none.
    pub fn read_as(format: Format) -> Option<Self> {
        match format {
            Format::Oxford => Some(Self::Oxford),
            Format::Boreas | Format::BoreasRt => Some(Self::Boreas),
            Format::Radiate => Some(Self::Radiate),
            Format::Oord | Format::Mulran | Format::MulranOxfordForm | Format::Fomo => None,
        }
    }
}

/// How a host receives scans.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum HostStamps {
    /// Each at the same delay.
    #[default]
    Even,
    /// About once in 64 scans it stalls for up to 1.4 s and then catches up, as in RADIATE's recordings.
    Stalling,
}
