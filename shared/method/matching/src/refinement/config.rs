use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use gyre_geometry::{SettingError, check, check_bounds};

use crate::config::POSITIVE;

/// Tolerance of the limit of acceleration for the noise of matches, m.
pub(super) const JITTER_M: f64 = 0.8;
/// Tolerance of the limit of yaw acceleration for the noise of matches, degrees.
pub(super) const JITTER_DEG: f64 = 3.0;
/// Cell size of the coarse map, where registration starts, over the cell size of the fine map.
pub(super) const COARSE: f64 = 3.0;

/// Configuration of [`Refiner`](crate::Refiner): section `[refinement]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RefinementConfig {
    /// `none`: the searched motion is the result. `local-map`: it is refined by registration
    /// against a map of the last keyframes.
    pub kind: RefinementKind,
    /// Number of keyframes in the map, 1 to 64. 1 registers against the last keyframe alone.
    pub keyframes: usize,
    /// Size of a cell of the map, m. The map is blurred by a Gaussian with a standard deviation of
    /// one cell.
    pub cell_m: f64,
    /// Extent of the map to each side of its newest keyframe, m: a little more than
    /// `points.max_range_m`.
    pub reach_m: f64,
    /// Maximum acceleration of the vehicle, m/s². A match that exceeds it is rejected.
    pub acceleration_mps2: f64,
    /// Maximum yaw acceleration of the vehicle, degrees/s². A match that exceeds it is rejected.
    pub yaw_acceleration_degps2: f64,
    /// Minimum overlap with the map, as a share of its running mean. A match below it is rejected.
    pub min_overlap: f64,
    /// Overlap with the map, as a share of its running mean, below which a match is `weak`: it is
    /// used, but its scan stays out of the map.
    pub firm_overlap: f64,
    /// Factor of the covariance: factor x mean weight of the points x mean squared residual x
    /// inverse information matrix.
    pub variance_scale: f64,
    /// Standard deviation of the heading that is added to the covariance, degrees, for the uneven
    /// rotation of the antenna.
    pub yaw_sigma_deg: f64,
    /// Standard deviation of the drift of a map of k keyframes with each motion, over 2 / (k + 1)
    /// of the motion's standard deviation. The share (drift_scale x 2 / (k + 1))² of the covariance
    /// accumulates, at most all of it; the next motion takes back the rest.
    pub drift_scale: f64,
    /// Standard deviation of the scale that all motions of a drive share: how well the range
    /// resolution is known.
    pub scale_sigma: f64,
    /// Holds the pose of a standing vehicle: no motion until the displacement exceeds the noise.
    pub hold_standstill: bool,
}

/// The refinement of searched motions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RefinementKind {
    /// No refinement.
    None,
    /// Registration against the local map.
    #[default]
    LocalMap,
}

impl Default for RefinementConfig {
    fn default() -> Self {
        Self {
            kind: RefinementKind::default(),
            keyframes: 10,
            cell_m: 0.3,
            reach_m: 85.0,
            acceleration_mps2: 6.0,
            yaw_acceleration_degps2: 90.0,
            min_overlap: 0.5,
            firm_overlap: 0.7,
            variance_scale: 0.7,
            yaw_sigma_deg: 0.19,
            drift_scale: 2.0,
            scale_sigma: 0.01,
            hold_standstill: true,
        }
    }
}

impl RefinementConfig {
    pub fn validate(&self) -> Result<(), SettingError> {
        let keyframes = ([1.0, 64.0], "1 to 64");
        check("refinement", "keyframes", self.keyframes as f64, keyframes)?;
        let cells = [8.0, 1000.0].map(|cells| cells * self.cell_m);
        let share = ([0.0, 1.0], "a share, 0 to 1");
        check_bounds! { self, "refinement":
            cell_m in ([0.05, 10.0], "metres, 0.05 to 10"),
            reach_m in (cells, "8 to 1000 cells of cell_m"),
            min_overlap in share,
            firm_overlap in share,
            acceleration_mps2 in POSITIVE,
            yaw_acceleration_degps2 in POSITIVE,
            variance_scale in POSITIVE,
            drift_scale in POSITIVE,
            yaw_sigma_deg in ([0.0, 90.0], "0 to 90"),
            scale_sigma in share,
        }
        Ok(())
    }
}
