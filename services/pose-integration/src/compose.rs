//! The composition of poses and motions.

use gyre_geometry::{covariance, xy_yaw};
use gyre_messages::{MotionHeader, PoseHeader};

/// Composes the previous pose (the origin without one) and a motion (zero at the start of a chain) to the next pose. The covariance
/// is propagated to first order (Checchin et al., Eqs. 1 and 2), but the noise of a scan's registration does not accumulate: see
/// [`Stretch`](gyre_geometry::Stretch).
pub fn compose(previous: Option<&PoseHeader>, motion: &MotionHeader) -> PoseHeader {
    let start = PoseHeader::default();
    let previous = previous.unwrap_or(&start);
    let next = previous.stretch().then(&motion.motion.motion());
    let pose = next.motion();
    let [x_m, y_m, yaw_rad] = xy_yaw(&pose.motion);
    PoseHeader {
        item: motion.item,
        motion: motion.motion,
        x_m,
        y_m,
        yaw_rad,
        covariance: covariance::pack(&pose.covariance),
        lasting_covariance: covariance::pack(&next.lasting().covariance),
        trajectory_version: previous.trajectory_version,
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
                drift_share: 1.0,
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
