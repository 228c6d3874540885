//! The velocity of the radar by the Doppler shift of a scan.

use serde::Serialize;

use gyre_radar::{DopplerEstimator, NoDoppler, PointsConfig, PolarScan};

/// The velocity of the radar by the Doppler shift of one scan.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct VelocityReport {
    /// Ahead and to the left, m/s; `None`: the scan does not say it.
    pub velocity_mps: Option<[f64; 2]>,
    /// Standard deviations of both, m/s.
    pub sigma_mps: Option<[f64; 2]>,
    /// Number of bearings that agree with it.
    pub bearings: u64,
    /// The reason why the scan does not say it.
    pub error: Option<String>,
}

/// Estimates the velocity of a scan whose chirps alternate; `None` of another one.
pub(super) fn examine(scan: &PolarScan<'_>) -> Option<VelocityReport> {
    let min_range_m = PointsConfig::default().min_range_m;
    match DopplerEstimator::default().estimate(scan, min_range_m) {
        Ok(found) => {
            let [x, _, y] = found.covariance;
            Some(VelocityReport {
                velocity_mps: Some(found.velocity_mps),
                sigma_mps: Some([x.sqrt(), y.sqrt()]),
                bearings: found.bearings,
                error: None,
            })
        }
        Err(NoDoppler::UnknownChirps | NoDoppler::NotAlternating { .. } | NoDoppler::Scan(_)) => {
            None
        }
        Err(error) => Some(VelocityReport {
            velocity_mps: None,
            sigma_mps: None,
            bearings: 0,
            error: Some(error.to_string()),
        }),
    }
}
