//! In which form the scans come out: the section `[simulation.output]`.

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

impl OutputFormat {
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
