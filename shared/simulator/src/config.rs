//! What to simulate.

use gyre_radar::DatasetOptions;
use serde::{Deserialize, Serialize};

use crate::drive::DriveConfig;
use crate::error::SimulatorError;
use crate::limits::require_within;
use crate::output::{OutputConfig, OutputFormat};
use crate::profile::Chirp;
use crate::sensor::{Effects, SensorConfig};
use crate::town::TownConfig;
use crate::traffic::TrafficConfig;
use crate::weather::WeatherConfig;

/// What to simulate. Every key has a default, and unknown keys are refused.
///
/// One configuration gives one dataset, byte for byte (for one build on one kind of machine: sines and logarithms are the system's).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SimulationConfig {
    /// Scans to generate. Round a block the vehicle keeps circling as long as they last; where another drive ends, it stands.
    pub scans: usize,
    /// Where all randomness comes from: the town, the speckle, the noise.
    pub seed: u64,
    /// Which way the vehicle takes.
    pub drive: DriveConfig,
    /// What lines the streets.
    pub town: TownConfig,
    /// What moves besides.
    pub traffic: TrafficConfig,
    /// What measures.
    pub sensor: SensorConfig,
    /// What makes scans hard.
    pub effects: Effects,
    /// What the weather is like, and from when on. Default: clear.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub weather: Vec<WeatherConfig>,
    /// In which form the scans come out.
    pub output: OutputConfig,
}

impl Default for SimulationConfig {
    fn default() -> Self {
        Self {
            scans: 64,
            seed: 1,
            drive: DriveConfig::default(),
            town: TownConfig::default(),
            traffic: TrafficConfig::default(),
            sensor: SensorConfig::default(),
            effects: Effects::default(),
            weather: Vec::new(),
            output: OutputConfig::default(),
        }
    }
}

impl SimulationConfig {
    /// Refuses what cannot be simulated, naming the key.
    pub fn validate(&self) -> Result<(), SimulatorError> {
        require_within("scans", self.scans as f64, 1.0, 100_000.0)?;
        self.drive.validate()?;
        self.town.validate()?;
        self.traffic.validate()?;
        self.sensor.validate()?;
        self.weather.iter().try_for_each(WeatherConfig::validate)
    }

    /// How a reader of its scans is to read them, so that ranges and angles come out as they were.
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
