//! Revisited places: the relative poses measured there, compared with a trajectory. They cannot
//! be judged by a ground truth whose positions drift, such as GNSS: the truth contradicts them too.

use gyre_geometry::Pose;
use serde::Serialize;

/// Differences between measured relative poses and a trajectory.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LoopErrors {
    pub loops: usize,
    /// RMS of the distance, m.
    pub translation_rmse_m: f64,
    /// RMS of the rotation, degrees.
    pub rotation_rmse_deg: f64,
}

/// Compares measured relative poses with the relative poses of a trajectory, in pairs; `None`
/// without any.
pub fn loop_errors(pairs: impl IntoIterator<Item = (Pose, Pose)>) -> Option<LoopErrors> {
    let (mut loops, mut square_m2, mut square_deg2) = (0, 0.0, 0.0);
    for (measured, by_trajectory) in pairs {
        let error = measured.inv_mul(&by_trajectory);
        loops += 1;
        square_m2 += error.translation.vector.norm_squared();
        square_deg2 += error.rotation.angle().to_degrees().powi(2);
    }
    (loops > 0).then(|| LoopErrors {
        loops,
        translation_rmse_m: (square_m2 / loops as f64).sqrt(),
        rotation_rmse_deg: (square_deg2 / loops as f64).sqrt(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use gyre_geometry::pose;

    #[test]
    fn errors_are_of_the_relative_poses_whatever_their_frame() {
        let right = pose(3.0, -4.0, 3.0);
        assert_eq!(loop_errors([]), None);
        let found = loop_errors([(right, right), (right, right * pose(0.6, 0.8, -0.02))]).unwrap();
        assert_eq!(found.loops, 2);
        assert!((found.translation_rmse_m - 0.5f64.sqrt()).abs() < 1e-12);
        assert!((found.rotation_rmse_deg - 0.02f64.to_degrees() * 0.5f64.sqrt()).abs() < 1e-12);
    }
}
