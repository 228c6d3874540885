//! The part of the summary about GNSS.

use gyre_datasets::{GnssFaults, GnssLog};
use gyre_estimation::EstimationError;
use gyre_geometry::{UncertainMotion, xy_yaw};
use gyre_mapping::Origin;
use gyre_slam::{FixRefusal, TrajectoryEstimator};
use serde::Serialize;
use serde_json::{Value, json};

/// Fixes with a smaller weight count as refused: they pull less than a quarter as hard.
const LEAST_WEIGHT: f64 = 0.25;

#[derive(Debug, Serialize)]
pub struct GnssSummary {
    log: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    topic: Option<String>,
    fixes: usize,
    faults: GnssFaults,
    /// Fixes before the first keyframe or after the last.
    outside: usize,
    /// Fixes that are farther from their keyframe than a different fix.
    thinned: usize,
    /// Fixes too far from a keyframe for odometry to predict the place of the vehicle.
    far: usize,
    used: usize,
    /// Fixes that contradict the others, the odometry or the loops.
    refused: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    refusal: Option<String>,
    /// Delay of the fixes, estimated from their speeds, beyond `gnss.delay_s`, s; `None` if the
    /// drive does not determine it.
    #[serde(skip_serializing_if = "Option::is_none")]
    delay_s: Option<f64>,
    /// Root mean square of the distances of the used fixes from the corrected trajectory, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    residual_rms_m: Option<f64>,
    /// The pose of the frame of `trajectory_slam.tum` in the plane of the fixes.
    #[serde(skip_serializing_if = "Option::is_none")]
    east_north: Option<Value>,
    /// Where that plane touches the earth: latitude and longitude (WGS 84), degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    plane: Option<[f64; 2]>,
    /// The place of the frame of `trajectory_slam.tum` on the earth.
    #[serde(skip_serializing_if = "Option::is_none")]
    origin: Option<Origin>,
}

/// Returns a pose in the plane of the fixes with its standard deviations; the direction of the x
/// axis is counter-clockwise from east.
fn east_north(pose: &UncertainMotion) -> Value {
    let [east_m, north_m, yaw_rad] = xy_yaw(&pose.motion);
    let variances = pose.covariance.diagonal();
    let sigma = variances.map(|variance| variance.max(0.0).sqrt());
    json!({
        "east_m": east_m,
        "north_m": north_m,
        "yaw_deg": yaw_rad.to_degrees(),
        "east_sigma_m": sigma.x,
        "north_sigma_m": sigma.y,
        "yaw_sigma_deg": sigma.z.to_degrees(),
    })
}

impl GnssSummary {
    pub fn of(log: &GnssLog, estimator: &mut TrajectoryEstimator) -> Result<Self, EstimationError> {
        let positions = estimator.positions();
        let used = positions.iter().filter(|it| it.weight >= LEAST_WEIGHT);
        let squares = used.map(|it| it.chi_square * it.position.variance_m2);
        let squares: Vec<f64> = squares.collect();
        let rms_m = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        let frame = estimator.east_north_from_map()?;
        let origin = frame.zip(log.plane).map(|(frame, plane)| {
            let [east_m, north_m, yaw_rad] = xy_yaw(&frame.motion);
            let place = plane.place([east_m, north_m]);
            Origin {
                latitude_deg: place.latitude_deg,
                longitude_deg: place.longitude_deg,
                heading_deg: plane.heading_deg([east_m, north_m], yaw_rad),
            }
        });
        let fixes = estimator.fixes();
        let counts = fixes.counts();
        let refusal = || fixes.refusal().map(ToString::to_string);
        Ok(Self {
            log: log.path.display().to_string(),
            topic: log.topic.clone(),
            fixes: log.fixes.len(),
            faults: log.faults.clone(),
            outside: counts.outside,
            thinned: counts.thinned,
            far: counts.far,
            used: squares.len(),
            refused: counts.taken - squares.len(),
            refusal: log.unusable.clone().or_else(refusal),
            delay_s: fixes.clock().map(|clock| clock.delay_s),
            residual_rms_m: (!squares.is_empty()).then_some(rms_m),
            east_north: frame.as_ref().map(east_north),
            plane: log.plane.map(|plane| {
                let origin = plane.origin();
                [origin.latitude_deg, origin.longitude_deg]
            }),
            origin,
        })
    }

    /// Returns why no fix is used, and whether that is a problem: of a vehicle that hardly moved it
    /// is not.
    pub fn refusal(&self) -> Option<(&str, bool)> {
        let refusal = self.refusal.as_deref()?;
        Some((refusal, refusal != FixRefusal::Undetermined.to_string()))
    }
}
