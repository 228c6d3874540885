//! The part of the summary about GNSS.

use gyre_datasets::SampleLog;
use gyre_geometry::{UncertainMotion, xy_yaw};
use gyre_slam::{FixRefusal, TrajectoryEstimator, estimation::EstimationError, mapping::Origin};
use serde::Serialize;
use serde_json::{Value, json};

/// Fixes with a smaller weight count as refused: they pull less than a quarter as hard.
const LEAST_WEIGHT: f64 = 0.25;

#[derive(Debug, Serialize)]
pub struct GnssSummary {
    /// The figures without those that are not known.
    #[serde(flatten)]
    figures: Value,
    #[serde(skip)]
    refusal: Option<String>,
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
    pub fn of(
        log: &SampleLog,
        estimator: &mut TrajectoryEstimator,
    ) -> Result<Self, EstimationError> {
        let positions = estimator.positions();
        let used = positions.iter().filter(|it| it.weight >= LEAST_WEIGHT);
        let squares = Vec::from_iter(used.map(|it| it.chi_square * it.position.variance_m2));
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
        let refusal = log.unusable.clone().or_else(refusal);
        let mut figures = json!({
            "log": log.path.display().to_string(),
            "topic": log.topic,
            "fixes": log.samples.len(),
            "faults": log.fault_figures(),
            // Before the first keyframe or after the last.
            "outside": counts.outside,
            // Farther from their keyframe than a different fix.
            "thinned": counts.thinned,
            // Too far from a keyframe for odometry to predict the place of the vehicle.
            "far": counts.far,
            "used": squares.len(),
            // They contradict the others, the odometry or the loops.
            "refused": counts.taken - squares.len(),
            "refusal": refusal,
            // Estimated from their speeds, beyond `gnss.delay_s`.
            "delay_s": fixes.clock().map(|clock| clock.delay_s),
            // From the corrected trajectory.
            "residual_rms_m": (!squares.is_empty()).then_some(rms_m),
            // The pose of the frame of `trajectory_slam.tum` in the plane of the fixes.
            "east_north": frame.as_ref().map(east_north),
            // Where that plane touches the earth: latitude and longitude (WGS 84), degrees.
            "plane": log.plane.map(|it| it.origin()).map(|it| [it.latitude_deg, it.longitude_deg]),
            // The place of that frame on the earth.
            "origin": origin,
        });
        if let Some(figures) = figures.as_object_mut() {
            figures.retain(|_, figure| !figure.is_null());
        }
        Ok(Self { figures, refusal })
    }

    /// Returns why no fix is used, and whether that is a problem: of a vehicle that hardly moved it
    /// is not.
    pub fn refusal(&self) -> Option<(&str, bool)> {
        let refusal = self.refusal.as_deref()?;
        Some((refusal, refusal != FixRefusal::Undetermined.to_string()))
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use gyre_geometry::{
        pose,
        samples::{GnssConfig, GnssFix, SampleKind},
    };
    use gyre_slam::{EstimatorKind, Fixes, Keyframe};
    use nalgebra::Matrix3;

    use super::*;

    fn keyframe(k: u64) -> Keyframe {
        let along = |x_m| UncertainMotion {
            motion: pose(x_m, 0.0, 0.0),
            covariance: 0.01 * Matrix3::identity(),
        };
        Keyframe {
            stamp_ns: 250_000_000 * k as i64,
            motion: along(2.0),
            path_m: 2.0 * k as f64,
            ..Keyframe::standing(k, along(2.0 * k as f64), Vec::new())
        }
    }

    #[test]
    fn fixes_that_the_estimator_refuses_are_a_problem_and_place_nothing_on_the_earth() {
        // They begin an hour after the drive.
        let later = (0..20).map(|k| GnssFix {
            stamp_ns: 3_600_000_000_000 + 200_000_000 * k,
            east_m: k as f64,
            north_m: 2.0,
            sigma_m: 1.0,
        });
        let fixes = Fixes::new(later.collect(), &GnssConfig::default());
        let mut estimator = TrajectoryEstimator::new(EstimatorKind::Graph).with_fixes(fixes);
        for k in 0..4 {
            estimator.push(&keyframe(k)).unwrap();
        }
        estimator.solve().unwrap();
        let summary = GnssSummary::of(
            &SampleLog::new(SampleKind::Gnss, Path::new("")),
            &mut estimator,
        )
        .unwrap();
        let reason = FixRefusal::Elsewhere.to_string();
        assert_eq!(summary.refusal(), Some((reason.as_str(), true)));
        let figures = serde_json::to_value(&summary).unwrap();
        assert_eq!(figures["refusal"], reason);
        assert_eq!(figures["used"], 0);
        assert!(figures.get("origin").is_none() && figures.get("residual_rms_m").is_none());
    }
}
