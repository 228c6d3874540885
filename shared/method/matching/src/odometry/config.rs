use crate::{ExhaustiveConfig, RefinementConfig, RotationConfig, TranslationConfig};
use gyre_geometry::samples::SensorConfigs;
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
    /// The sensors beside the radar.
    #[serde(flatten)]
    pub sensors: SensorConfigs,
}

impl OdometryConfig {
    pub fn has_samples(&self) -> bool {
        let sampled = self.sensors.sampled();
        sampled.iter().any(|sensor| sensor.kind().is_used())
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
