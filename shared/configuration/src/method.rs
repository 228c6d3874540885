//! The settings that decide the computed result.

use gyre_datasets::DatasetOptions;
use gyre_geometry::samples::GnssConfig;
use gyre_matching::odometry::OdometryConfig;
use gyre_objects::ObjectsConfig;
use gyre_slam::SlamConfig;
use serde::Serialize;
use toml::Table;

use crate::{
    ConfigurationError,
    strict::{section, within},
};

/// The sections of a configuration that decide the result and the radar; its file may have other
/// sections, which are for a run of processes.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct MethodConfig {
    pub dataset: DatasetOptions,
    #[serde(flatten)]
    pub odometry: OdometryConfig,
    pub slam: SlamConfig,
    pub gnss: GnssConfig,
    pub objects: ObjectsConfig,
}

/// Defines the names of the sections, how they are taken out of a table, and how their values are
/// checked.
macro_rules! sections {
    (checked: $($checked:ident)*; unchecked: $($unchecked:ident)*; others: $($other:ident)*) => {
        pub const SECTIONS: &[&str] = &[
            $(stringify!($checked),)* $(stringify!($unchecked),)* $(stringify!($other),)*
        ];

        /// Takes the sections out of a configuration; those that are missing have their defaults.
        pub fn take(table: &mut Table) -> Result<Self, ConfigurationError> {
            Ok(Self {
                odometry: OdometryConfig {
                    $($checked: section(table, stringify!($checked))?,)*
                    $($unchecked: section(table, stringify!($unchecked))?,)*
                },
                $($other: section(table, stringify!($other))?,)*
            })
        }

        pub fn check(odometry: &OdometryConfig, gnss: &GnssConfig) -> Result<(), ConfigurationError> {
            $(within(stringify!($checked), odometry.$checked.validate())?;)*
            within("gnss", gnss.validate())
        }
    };
}

impl MethodConfig {
    sections! {
        checked: raster points masking rotation translation refinement gyro wheels doppler;
        unchecked: search exhaustive;
        others: dataset slam gnss objects
    }

    /// The names of the other sections of a configuration, which are for a run of processes.
    pub const SECTIONS_OF_A_RUN: [&str; 7] = [
        "run",
        "source",
        "simulation",
        "budget",
        "record",
        "link",
        "stages",
    ];
}
