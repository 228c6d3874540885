use crate::{ExhaustiveConfig, RefinementConfig, RotationConfig, TranslationConfig};
use gyre_geometry::samples::{
    DopplerConfig, GyroConfig, SensorConfig, SensorConfigs, WheelsConfig,
};
use gyre_masking::MaskingConfig;
use gyre_radar::{PointsConfig, RasterConfig};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The settings of the method, by section of a run's configuration. A run's file can be read as
/// this: other sections are ignored.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct OdometryConfig {
    /// The Cartesian rasters.
    pub raster: RasterConfig,
    /// The sparse points, which the refinement registers.
    pub points: PointsConfig,
    /// Masks and motion compensation.
    pub masking: MaskingConfig,
    /// The kind of the search.
    pub search: SearchConfig,
    /// The rotation search.
    pub rotation: RotationConfig,
    /// The translation search.
    pub translation: TranslationConfig,
    /// The exhaustive search, for `search.kind = "exhaustive"`.
    pub exhaustive: ExhaustiveConfig,
    /// The refinement of searched motions.
    pub refinement: RefinementConfig,
    /// The gyro, if there is one.
    pub gyro: GyroConfig,
    /// The wheels, if their speed is known.
    pub wheels: WheelsConfig,
    /// The velocity by the Doppler shift of single scans.
    pub doppler: DopplerConfig,
}

impl OdometryConfig {
    /// The sensors whose samples come with the scans.
    pub fn sensors(&self) -> [&dyn SensorConfig; 2] {
        [&self.gyro, &self.wheels]
    }

    pub(crate) fn sensor_configs(&self) -> SensorConfigs {
        SensorConfigs {
            gyro: self.gyro.clone(),
            wheels: self.wheels.clone(),
            doppler: self.doppler.clone(),
        }
    }

    pub fn has_samples(&self) -> bool {
        self.sensors().iter().any(|sensor| sensor.kind().is_used())
    }
}

/// The section `[search]`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SearchConfig {
    /// `decoupled`: rotation, then translation. `exhaustive`: both together, every angle.
    pub kind: SearchKind,
}

/// The kind of a search.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SearchKind {
    /// Rotation first, from the Fourier magnitudes, then translation (Weston et al., Sec. III-C).
    #[default]
    Decoupled,
    /// Every angle of a grid with its whole correlation over the shifts.
    Exhaustive,
}
