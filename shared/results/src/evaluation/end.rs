//! End-point error: the drift of a whole drive.

use serde::Serialize;

use crate::evaluation::MatchedPoses;

/// The error of the last pose once the first poses are aligned in position and heading (Checchin et
/// al., Fig. 3, its last sample).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct EndError {
    pub position_m: f64,
    /// The same as a share of the path length, %; `None` if the ground truth does not move.
    pub percent: Option<f64>,
    /// Error of the last heading, estimate less ground truth, degrees in (-180, 180].
    pub heading_deg: f64,
}

/// Compares the motion from the first to the last matched pose with the true one.
pub fn end_error(matched: &MatchedPoses) -> EndError {
    let last = matched.len() - 1;
    let (estimate, truth) = (matched.estimate(), matched.truth());
    let [estimated, actual] = [estimate, truth].map(|poses| poses[0].inv_mul(&poses[last]));
    let position_m = (estimated.translation.vector - actual.translation.vector).norm();
    let turn = actual.rotation.rotation_to(&estimated.rotation);
    let path_m = crate::evaluation::matched::path_m(truth);
    EndError {
        position_m,
        percent: (path_m > 0.0).then(|| 100.0 * position_m / path_m),
        heading_deg: turn.angle().to_degrees(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gyre_geometry::pose;

    #[test]
    fn only_the_motion_from_the_first_to_the_last_pose_counts() {
        let truth = [(5.0, 0.0), (15.0, 0.0), (25.0, 0.1)];
        let truth = truth.map(|(x, yaw)| pose(x, 5.0, yaw)).to_vec();
        // Another start and heading, errors on the way, and an end 3 m ahead and 4 m to the left.
        let start = pose(-7.0, 2.0, 1.0);
        let [on_the_way, last] = [pose(99.0, 0.0, 2.0), pose(23.0, 4.0, 0.2)];
        let estimate = vec![start, start * on_the_way, start * last];
        let end = end_error(&MatchedPoses::new(estimate, truth));
        assert!((end.position_m - 5.0).abs() < 1e-9);
        assert!((end.heading_deg - 0.1f64.to_degrees()).abs() < 1e-9);
        assert!((end.percent.unwrap() - 25.0).abs() < 1e-9, "of 20 m");
    }

    #[test]
    fn a_standing_ground_truth_has_no_relative_error() {
        let end = end_error(&MatchedPoses::new(
            vec![pose(0.0, 0.0, 0.0); 2],
            vec![pose(1.0, 1.0, 0.5); 2],
        ));
        assert_eq!((end.position_m, end.percent), (0.0, None));
    }
}
