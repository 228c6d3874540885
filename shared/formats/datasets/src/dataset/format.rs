//! The file formats of datasets.

use std::fmt;

use serde::{Deserialize, Serialize};

/// A file format; configurations name it in kebab case (`boreas-rt`).
#[derive(
    Clone,
    Copy,
    Debug,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    Hash,
    Serialize,
    Deserialize,
    schemars::JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum Format {
    /// Oxford Radar RobotCar.
    Oxford,
    /// Oxford Offroad Radar Dataset.
    Oord,
    /// Boreas.
    Boreas,
    /// Boreas Road Trip.
    BoreasRt,
    /// MulRan as recorded: transposed images (range x azimuth) without metadata.
    Mulran,
    /// MulRan converted to the columns of Oxford.
    MulranOxfordForm,
    /// RADIATE.
    Radiate,
    /// FoMo.
    Fomo,
    /// A recording of a run as MCAP, of `gyre record`.
    Mcap,
    /// A format that Gyre has no reader for: of a program with a [`Dataset`](super::Dataset) of its
    /// own. No configuration names it.
    #[serde(skip_deserializing)]
    Other,
    /// A bag of ROS 2 with the messages of Navtech's driver.
    Ros2Bag,
}

impl Format {
    /// All formats of folders of images, in the order of preference if several fit equally.
    pub const ALL: [Self; 8] = [
        Self::Oxford,
        Self::Oord,
        Self::Boreas,
        Self::BoreasRt,
        Self::Mulran,
        Self::MulranOxfordForm,
        Self::Radiate,
        Self::Fomo,
    ];

    pub fn by_name(name: &str) -> Option<Self> {
        let mut all = Self::ALL.into_iter().chain([Self::Mcap, Self::Ros2Bag]);
        all.find(|format| format.name() == name)
    }

    pub const fn name(self) -> &'static str {
        match self {
            Self::Oxford => "oxford",
            Self::Oord => "oord",
            Self::Boreas => "boreas",
            Self::BoreasRt => "boreas-rt",
            Self::Mulran => "mulran",
            Self::MulranOxfordForm => "mulran-oxford-form",
            Self::Radiate => "radiate",
            Self::Fomo => "fomo",
            Self::Mcap => "mcap",
            Self::Other => "other",
            Self::Ros2Bag => "ros2-bag",
        }
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}
