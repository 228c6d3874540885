//! The settings that decide the computed result.

use gyre_datasets::DatasetOptions;
use gyre_geometry::samples::{GnssConfig, SensorConfig as _, SensorConfigs, Witness};
use gyre_matching::odometry::OdometryConfig;
use gyre_objects::ObjectsConfig;
use gyre_slam::SlamConfig;
use serde::Serialize;
use toml::Table;

use crate::{
    ConfigurationError,
    strict::{read, section, value, within},
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
        pub fn sections() -> Vec<&'static str> {
            let checked = &[$(stringify!($checked),)*][..];
            let others = &[$(stringify!($unchecked),)* $(stringify!($other),)*];
            [checked, &Witness::ALL.map(Witness::name), others].concat()
        }

        /// Takes the sections out of a configuration; those that are missing have their defaults.
        pub fn take(table: &mut Table) -> Result<Self, ConfigurationError> {
            Ok(Self {
                odometry: OdometryConfig {
                    $($checked: section(table, stringify!($checked))?,)*
                    $($unchecked: section(table, stringify!($unchecked))?,)*
                    sensors: sensors(table)?,
                },
                $($other: section(table, stringify!($other))?,)*
            })
        }

        pub fn check(odometry: &OdometryConfig, gnss: &GnssConfig) -> Result<(), ConfigurationError> {
            $(within(stringify!($checked), odometry.$checked.validate())?;)*
            let sensors = odometry.sensors.validate().and_then(|()| gnss.validate());
            sensors.map_err(|error| value(error.section, error))
        }
    };
}

impl MethodConfig {
    sections! {
        checked: raster points masking rotation translation refinement;
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

/// Takes the sections of the sensors beside the radar, and reads each alone, so that an error names
/// it.
fn sensors(table: &mut Table) -> Result<SensorConfigs, ConfigurationError> {
    let mut all = Table::new();
    for name in Witness::ALL.map(Witness::name) {
        if let Some(section) = table.remove(name) {
            let alone = Table::from_iter([(name.to_owned(), section.clone())]);
            read::<SensorConfigs>(name, alone.into())?;
            all.insert(name.to_owned(), section);
        }
    }
    read("", all.into())
}
