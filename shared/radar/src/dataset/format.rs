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
}

impl Format {
    /// All formats, in the order of preference if several fit equally.
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

    /// The name in configurations.
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
        }
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}
