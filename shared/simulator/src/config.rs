use std::path::PathBuf;

use gyre_datasets::DatasetOptions;
use gyre_geometry::samples::SampleKind;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{
    beside::{
        Device,
        gnss::{self, SimulatedGnssConfig},
        gyro::{self, SimulatedGyroConfig},
        heading::{self, SimulatedHeadingConfig},
        wheels::{self, SimulatedWheelsConfig},
    },
    error::SimulatorError,
    output::{OutputConfig, OutputFormat},
    path::{BlockLoop, Path, recorded},
    sensor::SensorConfig,
};

pub(crate) const MAX_SCANS: usize = 100_000;
/// Lateral acceleration in the bends of a block, metres a second squared, which limits the speed.
const LATERAL_MPS2: f64 = 5.0;

/// The errors of the radar.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Realism {
    /// Noise, speckle, fluctuating echoes, a jittering encoder, and azimuths that are lost.
    #[default]
    Plain,
    /// No errors: each echo has its own power at its own place.
    Exact,
}

/// A simulation. Every key has a default, and unknown keys are rejected.
///
/// One configuration gives one dataset, byte for byte (with one build on one kind of machine: sines
/// and logarithms are the system's).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SimulationConfig {
    /// Scans to generate. A drive around a block is repeated as long as they last; a drive along a
    /// file has at most as many as it lasts. Default: the whole drive; 64 around a block.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scans: Option<usize>,
    /// The seed of the scenery and of all random errors.
    pub seed: u64,
    /// `plain`, or `exact` for a radar without errors.
    pub realism: Realism,
    /// Times between which the radome is blocked, so that the radar receives noise alone, seconds
    /// after the start. Default: never.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub blind_s: Option<[f64; 2]>,
    /// A tunnel: the distance driven where it begins, and its length, metres. Default: none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tunnel_m: Option<[f64; 2]>,
    /// The path of the vehicle.
    pub drive: DriveConfig,
    /// The radar.
    pub sensor: SensorConfig,
    /// The gyro beside the radar. Default: none.
    #[serde(skip_serializing_if = "is_default")]
    pub gyro: SimulatedGyroConfig,
    /// The speed of the wheels. Default: none.
    #[serde(skip_serializing_if = "is_default")]
    pub wheels: SimulatedWheelsConfig,
    /// The GNSS receiver beside the radar. Default: none.
    #[serde(skip_serializing_if = "is_default")]
    pub gnss: SimulatedGnssConfig,
    /// The absolute headings beside the radar. Default: none.
    #[serde(skip_serializing_if = "is_default")]
    pub heading: SimulatedHeadingConfig,
    /// The format of the dataset.
    pub output: OutputConfig,
}

fn is_default<T: Default + PartialEq>(section: &T) -> bool {
    *section == T::default()
}

impl Default for SimulationConfig {
    fn default() -> Self {
        Self {
            scans: None,
            seed: 1,
            realism: Realism::default(),
            blind_s: None,
            tunnel_m: None,
            drive: DriveConfig::default(),
            sensor: SensorConfig::default(),
            gyro: SimulatedGyroConfig::default(),
            wheels: SimulatedWheelsConfig::default(),
            gnss: SimulatedGnssConfig::default(),
            heading: SimulatedHeadingConfig::default(),
            output: OutputConfig::default(),
        }
    }
}

impl SimulationConfig {
    pub fn validate(&self) -> Result<(), SimulatorError> {
        let (drive, sensor) = (&self.drive, &self.sensor);
        let (gyro, wheels, gnss) = (&self.gyro, &self.wheels, &self.gnss);
        let heading = &self.heading;
        let scans = self.scans.unwrap_or(1) as f64;
        let [blind_s, sees_s] = self.blind_s.unwrap_or_default();
        let [begins_m, length_m] = self.tunnel_m.unwrap_or([0.0, 10.0]);
        let sampling = sensor.sampling();
        let (bins, azimuths) = (sampling.bins as f64, sampling.azimuths as f64);
        let eccentricity_rad = sensor.azimuth_eccentricity_rad;
        for (key, value, least, most) in [
            ("scans", scans, 1.0, MAX_SCANS as f64),
            ("blind_s", blind_s, 0.0, 1e6),
            ("blind_s", sees_s, blind_s, 1e6),
            ("tunnel_m", begins_m, 0.0, 1e5),
            ("tunnel_m", length_m, 10.0, 1e4),
            ("drive.block_m", drive.block_m[0], 30.0, 400.0),
            ("drive.block_m", drive.block_m[1], 30.0, 400.0),
            ("drive.speed_mps", drive.speed_mps, 0.5, 40.0),
            ("drive.from_s", drive.from_s, 0.0, 1e6),
            ("sensor.bins", bins, 16.0, 20_000.0),
            ("sensor.bin_m", sampling.range_resolution_m, 0.01, 5.0),
            ("sensor.azimuths", azimuths, 60.0, 4000.0),
            ("sensor.period_s", sensor.period_s.unwrap_or(1.0), 0.05, 2.0),
            ("sensor.beam_deg", sensor.beam_deg.unwrap_or(1.0), 0.1, 20.0),
            ("sensor.noise_db", sensor.noise_db, -20.0, 40.0),
            ("sensor.range_offset_m", sampling.range_offset_m, -5.0, 5.0),
            ("sensor.doppler_s", sampling.doppler_s, -0.5, 0.5),
            (
                "sensor.azimuth_eccentricity_rad",
                eccentricity_rad,
                -0.05,
                0.05,
            ),
            ("gyro.delay_s", gyro.delay_s, -1e6, 1e6),
            ("wheels.rate_hz", wheels.rate_hz, 0.0, 1000.0),
            ("wheels.delay_s", wheels.delay_s, -1e6, 1e6),
            ("gnss.rate_hz", gnss.rate_hz, 0.0, 100.0),
            ("heading.rate_hz", heading.rate_hz, 0.0, 1000.0),
            ("heading.noise_deg", heading.noise_deg, 0.0, 90.0),
            ("heading.offset_deg", heading.offset_deg, -360.0, 360.0),
            ("heading.delay_s", heading.delay_s, -1e6, 1e6),
        ] {
            if !(least..=most).contains(&value) {
                let expected = format!("between {least} and {most}");
                return Err(SimulatorError::key(key, value, expected));
            }
        }
        if sensor.lost_azimuths && self.output.format != Some(OutputFormat::Radiate) {
            let expected = "false unless output.format = \"radiate\": in other formats the azimuth of each row is written beside it";
            return Err(SimulatorError::key("sensor.lost_azimuths", true, expected));
        }
        Ok(())
    }

    /// Returns a sensor beside the radar; `None` if it is switched off.
    pub(crate) fn device<'a>(&self, of: SampleKind, path: &'a dyn Path) -> Option<Device<'a>> {
        match of {
            SampleKind::Gyro => gyro::device(&self.gyro, self.seed, path),
            SampleKind::Wheels => wheels::device(&self.wheels, self.seed, path),
            SampleKind::Gnss => gnss::device(&self.gnss, self.seed, path),
            SampleKind::Heading => heading::device(&self.heading, self.seed, path),
        }
    }

    pub(crate) fn sensor_seed(&self) -> u64 {
        self.sensor.seed.unwrap_or(self.seed)
    }

    pub fn dataset_options(&self) -> DatasetOptions {
        let sampling = self.sensor.sampling();
        let with_encoder = self.output.format != Some(OutputFormat::Radiate);
        DatasetOptions {
            range_resolution_m: Some(sampling.range_resolution_m as f32),
            range_offset_m: Some(sampling.range_offset_m as f32),
            doppler_s: Some(sampling.doppler_s as f32),
            azimuth_eccentricity_rad: Some(self.sensor.azimuth_eccentricity_rad as f32),
            encoder_counts: with_encoder.then_some(sampling.encoder_counts),
            ..DatasetOptions::default()
        }
    }
}

/// The path of the vehicle: laps around a block of houses, or a recorded trajectory.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct DriveConfig {
    /// Length and width of the block from street centre to street centre, metres.
    pub block_m: [f64; 2],
    /// Speed on the straights of the block, metres a second.
    pub speed_mps: f64,
    /// A trajectory to drive along instead, in any format that `gyre evaluate` reads. Poses without
    /// times are one sweep apart.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// Start in the file, seconds after its first pose.
    pub from_s: f64,
}

impl Default for DriveConfig {
    fn default() -> Self {
        Self {
            block_m: [40.0, 32.0],
            speed_mps: 9.5,
            file: None,
            from_s: 0.0,
        }
    }
}

impl DriveConfig {
    /// Builds the path, for a radar with so many sweeps a second.
    pub fn path(&self, rate_hz: f64) -> Result<Box<dyn Path>, SimulatorError> {
        let [length_m, width_m] = self.block_m;
        let Some(file) = &self.file else {
            let block = BlockLoop::new(length_m, width_m, self.speed_mps, LATERAL_MPS2);
            return Ok(Box::new(block));
        };
        Ok(Box::new(recorded::read(file, self.from_s, rate_hz)?))
    }
}
