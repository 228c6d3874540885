//! The file formats of datasets.

use std::fmt;

use serde::{Deserialize, Serialize};

gyre_geometry::named! {
    /// A file format; configurations name it in kebab case (`boreas-rt`).
    #[derive(
        Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
        schemars::JsonSchema,
    )]
    #[serde(rename_all = "kebab-case")]
    pub enum Format {
        /// Oxford Radar RobotCar.
        Oxford = "oxford",
        /// Oxford Offroad Radar Dataset.
        Oord = "oord",
        /// Boreas.
        Boreas = "boreas",
        /// Boreas Road Trip.
        BoreasRt = "boreas-rt",
        /// MulRan as recorded: transposed images (range x azimuth) without metadata.
        Mulran = "mulran",
        /// MulRan converted to the columns of Oxford.
        MulranOxfordForm = "mulran-oxford-form",
        /// RADIATE.
        Radiate = "radiate",
        /// FoMo.
        Fomo = "fomo",
        /// A recording of a run as MCAP, of `gyre record`.
        Mcap = "mcap",
        /// A format that Gyre has no reader for: of a program with a [`Dataset`](super::Dataset) of
        /// its own. No configuration names it.
        #[serde(skip_deserializing)]
        Other = "other",
        /// A bag of ROS 2 with the messages of Navtech's driver.
        Ros2Bag = "ros2-bag",
    }
}

impl Format {
    /// All formats of folders of images, in the order of preference if several fit equally.
    pub const OF_IMAGES: &'static [Self] = Self::ALL.split_at(Self::Mcap as usize).0;
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}
