//! The file formats of datasets.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Defines [`Format`] from its rows: the meaning of a format, and its name in kebab case.
macro_rules! formats {
    (
        images { $($(#[$of_images:meta])* $images:ident = $name:literal,)* }
        others { $($(#[$of_other:meta])* $other:ident = $other_name:literal,)* }
    ) => {
        /// A file format; configurations name it in kebab case (`boreas-rt`).
        #[derive(
            Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
            schemars::JsonSchema,
        )]
        #[serde(rename_all = "kebab-case")]
        pub enum Format {
            $($(#[$of_images])* $images,)*
            $($(#[$of_other])* $other,)*
        }

        impl Format {
            /// All formats of folders of images, in the order of preference if several fit equally.
            pub const ALL: [Self; [$($name),*].len()] = [$(Self::$images),*];

            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$images => $name,)*
                    $(Self::$other => $other_name,)*
                }
            }
        }
    };
}

formats! {
    images {
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
    }
    others {
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
    pub fn by_name(name: &str) -> Option<Self> {
        let mut all = Self::ALL.into_iter().chain([Self::Mcap, Self::Ros2Bag]);
        all.find(|format| format.name() == name)
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}
