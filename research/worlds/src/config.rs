//! The configuration of a simulation.

use gyre_datasets::DatasetOptions;
use serde::{Deserialize, Serialize};

use crate::drive::DriveConfig;
use crate::error::SimulatorError;
use crate::gnss::SimulatedGnssConfig;
use crate::gyro::SimulatedGyroConfig;
use crate::limits::require_within;
use crate::output::{OutputConfig, OutputFormat};
use crate::profile::Chirp;
use crate::realism::Realism;
use crate::sensor::{Effects, SensorConfig};
use crate::town::TownConfig;
use crate::traffic::TrafficConfig;
use crate::tunnel::TunnelConfig;
use crate::weather::WeatherConfig;
use crate::wheels::SimulatedWheelsConfig;

/// Maximum number of scans.
pub(crate) const MAX_SCANS: usize = 100_000;

/// A simulation. Every key has a default, and unknown keys are rejected.
///
/// One configuration gives one dataset, byte for byte (with one build on one kind of machine: sines
/// and logarithms are the system's).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SimulationConfig {
    /// Scans to generate. A drive round a block is repeated as long as they last; of any other
    /// drive there are no more than it lasts. Default: all of the drive; 64 round a block.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scans: Option<usize>,
    /// The seed of all randomness that has no seed of its own: `town.seed`, `town.changes_seed`,
    /// `traffic.seed`, `sensor.seed`, `gyro.seed`, `wheels.seed`, `gnss.seed`.
    pub seed: u64,
    /// The likeness to a real road: switches of `[simulation.effects]`, `town.belts` and
    /// `sensor.gain_db` that are left out are as it says. Default: `plain`.
    #[serde(skip_serializing_if = "Realism::is_plain")]
    pub realism: Realism,
    /// The path of the vehicle.
    pub drive: DriveConfig,
    /// The buildings and other objects along the streets.
    pub town: TownConfig,
    /// The other road users.
    pub traffic: TrafficConfig,
    /// The radar.
    pub sensor: SensorConfig,
    /// The effects of the sensor that are simulated.
    pub effects: Effects,
    /// The gyro beside the radar. Default: none.
    #[serde(skip_serializing_if = "SimulatedGyroConfig::is_default")]
    pub gyro: SimulatedGyroConfig,
    /// The speed by the vehicle's wheels. Default: none.
    #[serde(skip_serializing_if = "SimulatedWheelsConfig::is_default")]
    pub wheels: SimulatedWheelsConfig,
    /// The GNSS receiver beside the radar. Default: none.
    #[serde(skip_serializing_if = "SimulatedGnssConfig::is_default")]
    pub gnss: SimulatedGnssConfig,
    /// The weather, section by section of the drive. Default: clear.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub weather: Vec<WeatherConfig>,
    /// The tunnels, stretch by stretch of the drive. Default: none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub tunnels: Vec<TunnelConfig>,
    /// The format of the dataset.
    pub output: OutputConfig,
}

impl Default for SimulationConfig {
    fn default() -> Self {
        Self {
            scans: None,
            seed: 1,
            realism: Realism::default(),
            drive: DriveConfig::default(),
            town: TownConfig::default(),
            traffic: TrafficConfig::default(),
            sensor: SensorConfig::default(),
            effects: Effects::default(),
            gyro: SimulatedGyroConfig::default(),
            wheels: SimulatedWheelsConfig::default(),
            gnss: SimulatedGnssConfig::default(),
            weather: Vec::new(),
            tunnels: Vec::new(),
            output: OutputConfig::default(),
        }
    }
}

impl SimulationConfig {
    /// Checks that all values can be simulated.
    ///
    /// # Errors
    /// [`SimulatorError::Config`] with the key of the first value that cannot.
    pub fn validate(&self) -> Result<(), SimulatorError> {
        if let Some(scans) = self.scans {
            require_within("scans", scans as f64, 1.0, MAX_SCANS as f64)?;
        }
        self.drive.validate()?;
        self.town.validate()?;
        self.traffic.validate()?;
        self.sensor.validate()?;
        self.gyro.validate()?;
        self.wheels.validate()?;
        self.gnss.validate()?;
        self.weather.iter().try_for_each(WeatherConfig::validate)?;
        self.tunnels.iter().try_for_each(TunnelConfig::validate)
    }

    /// Returns the configuration with all that its realism decides written out.
    #[must_use]
    pub fn resolved(&self) -> Self {
        let mut config = self.clone();
        let road = self.realism == Realism::Road;
        for switch in config.effects.of_the_road() {
            switch.get_or_insert(road);
        }
        // Other formats write the azimuth of each row beside it.
        let can_lose = self.output.format == Some(OutputFormat::Radiate);
        let lost = &mut config.effects.lost_azimuths;
        lost.get_or_insert(road && can_lose);
        config.town.belts.get_or_insert(self.realism.belts());
        config.sensor.gain_db.get_or_insert(self.realism.gain_db());
        config
    }

    /// The seed of the town and of a drive of kind `town`, whose streets are the town's.
    pub fn town_seed(&self) -> u64 {
        self.town.seed.unwrap_or(self.seed)
    }

    /// The seed of the other road users.
    pub fn traffic_seed(&self) -> u64 {
        self.traffic.seed.unwrap_or(self.seed)
    }

    /// The seed of the radar's noise, the rain's drops among it.
    pub fn sensor_seed(&self) -> u64 {
        self.sensor.seed.unwrap_or(self.seed)
    }

    /// The seed of the gyro's errors and of its clock.
    pub fn gyro_seed(&self) -> u64 {
        self.gyro.seed.unwrap_or(self.seed)
    }

    /// The seed of the errors of the wheels.
    pub fn wheels_seed(&self) -> u64 {
        self.wheels.seed.unwrap_or(self.seed)
    }

    /// The seed of the errors of the GNSS receiver.
    pub fn gnss_seed(&self) -> u64 {
        self.gnss.seed.unwrap_or(self.seed)
    }

    /// Returns the options with which a reader gets the ranges and angles of the simulated radar.
    pub fn dataset_options(&self) -> DatasetOptions {
        let sampling = self.sensor.sampling();
        let doppler_s = match sampling.chirp {
            Chirp::Falling => -sampling.doppler_s,
            Chirp::Rising | Chirp::Alternating => sampling.doppler_s,
        };
        let with_encoder = self.output.format != Some(OutputFormat::Radiate);
        DatasetOptions {
            range_resolution_m: Some(sampling.range_resolution_m as f32),
            range_offset_m: Some(sampling.range_offset_m as f32),
            doppler_s: Some(doppler_s as f32),
            azimuth_eccentricity_rad: Some(self.sensor.azimuth_eccentricity_rad as f32),
            encoder_counts: with_encoder.then_some(sampling.encoder_counts),
            ..DatasetOptions::default()
        }
    }
}
