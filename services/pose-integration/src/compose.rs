//! A pose and a motion make the next pose.

use gyre_messages::{MotionHeader, PoseHeader};
use nalgebra::{Isometry2, Matrix3, Vector2};

/// The pose after `motion`. Without a pose before, or with no motion (the chain's start), the vehicle stays where it is.
///
/// The covariance follows to first order: that of the pose before, seen from the new place, and that of the motion, turned
/// into the first scan's frame (Checchin et al., Eqs. 1 and 2).
pub fn compose(before: Option<&PoseHeader>, motion: &MotionHeader) -> PoseHeader {
    let start = PoseHeader::default();
    let before = before.unwrap_or(&start);
    let pose = Isometry2::new(Vector2::new(before.x_m, before.y_m), before.yaw_rad);
    let step = Isometry2::new(
        Vector2::new(motion.motion.x_m, motion.motion.y_m),
        motion.motion.yaw_rad,
    );
    let after = pose * step;

    let moved = after.translation.vector - pose.translation.vector;
    let by_pose = Matrix3::new(1.0, 0.0, -moved.y, 0.0, 1.0, moved.x, 0.0, 0.0, 1.0);
    let by_motion = pose.rotation.to_rotation_matrix().to_homogeneous();
    let covariance = by_pose * symmetric(&before.covariance) * by_pose.transpose()
        + by_motion * symmetric(&motion.motion.covariance) * by_motion.transpose();
    PoseHeader {
        item: motion.item,
        motion: motion.motion,
        x_m: after.translation.x,
        y_m: after.translation.y,
        yaw_rad: after.rotation.angle(),
        covariance: upper_triangle(&covariance),
        trajectory_version: before.trajectory_version,
    }
}

fn symmetric(c: &[f64; 6]) -> Matrix3<f64> {
    Matrix3::new(c[0], c[1], c[2], c[1], c[3], c[4], c[2], c[4], c[5])
}

fn upper_triangle(m: &Matrix3<f64>) -> [f64; 6] {
    [
        m[(0, 0)],
        m[(0, 1)],
        m[(0, 2)],
        m[(1, 1)],
        m[(1, 2)],
        m[(2, 2)],
    ]
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use gyre_messages::MotionEstimate;

    use super::*;

    fn motion(x_m: f64, y_m: f64, yaw_rad: f64, covariance: [f64; 6]) -> MotionHeader {
        let motion = MotionEstimate {
            x_m,
            y_m,
            yaw_rad,
            covariance,
            ..MotionEstimate::default()
        };
        MotionHeader {
            motion,
            ..MotionHeader::default()
        }
    }

    #[test]
    fn a_left_turn_then_forward_ends_on_the_left() {
        let turned = compose(None, &motion(2.0, 0.0, FRAC_PI_2, [0.0; 6]));
        let end = compose(Some(&turned), &motion(3.0, 0.0, FRAC_PI_2, [0.0; 6]));
        assert!(
            (end.x_m - 2.0).abs() < 1e-12
                && (end.y_m - 3.0).abs() < 1e-12
                && (end.yaw_rad - PI).abs() < 1e-12
        );
    }

    #[test]
    fn an_uncertain_heading_spreads_sideways_with_the_distance() {
        let sigma_yaw = 0.01;
        let uncertain = compose(
            None,
            &motion(
                0.0,
                0.0,
                0.0,
                [0.0, 0.0, 0.0, 0.0, 0.0, sigma_yaw * sigma_yaw],
            ),
        );
        let end = compose(Some(&uncertain), &motion(100.0, 0.0, 0.0, [0.0; 6]));
        assert!(
            (end.covariance[3].sqrt() - 1.0).abs() < 1e-9,
            "1 m to the side after 100 m at 0.01 rad"
        );
        assert!(end.covariance[0] < 1e-12 && (end.covariance[4] - 0.01).abs() < 1e-9);
    }

    #[test]
    fn a_motions_spread_is_turned_with_the_pose() {
        let turned = compose(None, &motion(0.0, 0.0, FRAC_PI_2, [0.0; 6]));
        let end = compose(
            Some(&turned),
            &motion(1.0, 0.0, 0.0, [4.0, 0.0, 0.0, 1.0, 0.0, 0.0]),
        );
        assert!((end.covariance[0] - 1.0).abs() < 1e-12 && (end.covariance[3] - 4.0).abs() < 1e-12);
    }
}
