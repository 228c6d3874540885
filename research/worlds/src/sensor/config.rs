//! The radar: the section `[simulation.sensor]`.

use serde::{Deserialize, Serialize};

use crate::error::SimulatorError;
use crate::limits::require_within;
use crate::profile::{Profile, Receiver, Sampling};

/// The radar, and its deviations from its profile.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SensorConfig {
    /// The seed of noise, speckle, the drops of rain, the vehicle's pitch and roll, and the echoes
    /// that are fixed to the radar. Default: the seed of the simulation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// The radar. Default: `cts350x-oxford`.
    pub profile: Profile,
    /// Time of one sweep, seconds. Default: the profile's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub period_s: Option<f64>,
    /// Metres to add to a bin's range. Default: the profile's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range_offset_m: Option<f64>,
    /// Doppler shift: metres of range for each m/s of closing speed; 0 for a radar without the
    /// effect. Default: the profile's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub doppler_s: Option<f64>,
    /// Decibels by which it is more sensitive than its profile, -20 to 20. Default: 0, or as
    /// `simulation.realism` says.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gain_db: Option<f64>,
    /// Eccentricity of the encoder's disc, radians: the beam points to `azimuth + eccentricity *
    /// cos(azimuth)`, which `dataset.azimuth_eccentricity_rad` corrects. Default: 0.
    pub azimuth_eccentricity_rad: f64,
}

impl Default for SensorConfig {
    fn default() -> Self {
        Self {
            seed: None,
            profile: Profile::default(),
            period_s: None,
            range_offset_m: None,
            doppler_s: None,
            gain_db: None,
            azimuth_eccentricity_rad: 0.0,
        }
    }
}

impl SensorConfig {
    /// Checks that all values can be simulated.
    ///
    /// # Errors
    /// [`SimulatorError::Config`] with the key of the first value that cannot.
    pub fn validate(&self) -> Result<(), SimulatorError> {
        require_within("sensor.period_s", self.period_s.unwrap_or(1.0), 0.05, 2.0)?;
        require_within(
            "sensor.range_offset_m",
            self.range_offset_m.unwrap_or(0.0),
            -5.0,
            5.0,
        )?;
        require_within("sensor.gain_db", self.gain_db.unwrap_or(0.0), -20.0, 20.0)?;
        require_within("sensor.doppler_s", self.doppler_s.unwrap_or(0.0), -0.5, 0.5)?;
        require_within(
            "sensor.azimuth_eccentricity_rad",
            self.azimuth_eccentricity_rad,
            -0.05,
            0.05,
        )
    }

    /// The transmitter and receiver of the radar.
    pub fn receiver(&self) -> Receiver {
        let kind = self.profile.receiver();
        Receiver {
            constant: kind.constant * 10f64.powf(self.gain_db.unwrap_or(0.0) / 10.0),
            ..kind
        }
    }

    /// The sampling of the radar.
    pub fn sampling(&self) -> Sampling {
        let kind = self.profile.sampling();
        Sampling {
            period_us: self
                .period_s
                .map_or(kind.period_us, |period_s| (period_s * 1e6).round() as i64),
            range_offset_m: self.range_offset_m.unwrap_or(kind.range_offset_m),
            doppler_s: self.doppler_s.unwrap_or(kind.doppler_s),
            ..kind
        }
    }
}
