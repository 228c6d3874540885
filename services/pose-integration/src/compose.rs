//! A pose and a motion make the next pose.

use gyre_geometry::{covariance, xy_yaw};
use gyre_messages::{MotionHeader, PoseHeader};

/// The pose after `motion`. Without a pose before, or with no motion (the chain's start), the vehicle stays where it is.
///
/// The covariance follows to first order (Checchin et al., Eqs. 1 and 2).
pub fn compose(before: Option<&PoseHeader>, motion: &MotionHeader) -> PoseHeader {
    let start = PoseHeader::default();
    let before = before.unwrap_or(&start);
    let after = before.pose().then(&motion.motion.motion());
    let [x_m, y_m, yaw_rad] = xy_yaw(&after.motion);
    PoseHeader {
        item: motion.item,
        motion: motion.motion,
        x_m,
        y_m,
        yaw_rad,
        covariance: covariance::pack(&after.covariance),
        trajectory_version: before.trajectory_version,
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use gyre_messages::MotionEstimate;

    use super::*;

    #[test]
    fn motions_compose_to_a_pose_in_the_frame_of_the_first_scan() {
        let motion = |x_m: f64| MotionHeader {
            motion: MotionEstimate {
                x_m,
                yaw_rad: FRAC_PI_2,
                covariance: [4.0, 0.0, 0.0, 1.0, 0.0, 0.0],
                ..MotionEstimate::default()
            },
            ..MotionHeader::default()
        };
        let turned = compose(None, &motion(2.0));
        let end = compose(Some(&turned), &motion(3.0));
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
        assert!(near(end.x_m, 2.0) && near(end.y_m, 3.0) && near(end.yaw_rad, PI));
        assert!(near(end.covariance[0], 5.0) && near(end.covariance[3], 5.0));
    }
}
