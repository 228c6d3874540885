//! The settings that decide the computed result.

use gyre_datasets::DatasetOptions;
use gyre_objects::ObjectsConfig;
use gyre_odometry::OdometryConfig;
use gyre_samples::GnssConfig;
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
    /// The format of the recording, and the constants of its radar.
    pub dataset: DatasetOptions,
    /// The settings of the method: the sections from `raster` to `doppler`.
    #[serde(flatten)]
    pub odometry: OdometryConfig,
    /// The correction of the trajectory at places that are seen again.
    pub slam: SlamConfig,
    /// The fixes that the corrected trajectory is made with.
    pub gnss: GnssConfig,
    /// The tracking of moving objects.
    pub objects: ObjectsConfig,
}

impl MethodConfig {
    /// The names of the sections.
    pub const SECTIONS: [&str; 15] = [
        "dataset",
        "raster",
        "points",
        "masking",
        "search",
        "rotation",
        "translation",
        "exhaustive",
        "refinement",
        "gyro",
        "wheels",
        "doppler",
        "slam",
        "gnss",
        "objects",
    ];

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

    /// Takes the sections out of a configuration; those that are missing have their defaults.
    pub fn take(table: &mut Table) -> Result<Self, ConfigurationError> {
        Ok(Self {
            dataset: section(table, "dataset")?,
            odometry: OdometryConfig {
                raster: section(table, "raster")?,
                points: section(table, "points")?,
                masking: section(table, "masking")?,
                search: section(table, "search")?,
                rotation: section(table, "rotation")?,
                translation: section(table, "translation")?,
                exhaustive: section(table, "exhaustive")?,
                refinement: section(table, "refinement")?,
                gyro: section(table, "gyro")?,
                wheels: section(table, "wheels")?,
                doppler: section(table, "doppler")?,
            },
            slam: section(table, "slam")?,
            gnss: section(table, "gnss")?,
            objects: section(table, "objects")?,
        })
    }

    /// Checks the ranges of all values.
    pub fn validate(&self) -> Result<(), ConfigurationError> {
        let odometry = &self.odometry;
        within("raster", odometry.raster.validate())?;
        within("points", odometry.points.validate())?;
        within("masking", odometry.masking.validate())?;
        within("rotation", odometry.rotation.validate())?;
        within("translation", odometry.translation.validate())?;
        within("exhaustive", odometry.exhaustive.validate())?;
        within("refinement", odometry.refinement.validate())?;
        within("gyro", odometry.gyro.validate())?;
        within("wheels", odometry.wheels.validate())?;
        within("doppler", odometry.doppler.validate())?;
        within("gnss", self.gnss.validate())?;
        within("objects", self.objects.validate())
    }
}
