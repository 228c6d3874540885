//! The composition of poses and motions.

use gyre_geometry::{covariance, xy_yaw};

use crate::{MotionHeader, PoseHeader};

/// Composes the previous pose (the origin without one) and a motion (zero at the start of a chain)
/// to the next pose. The covariance is propagated to first order (Checchin et al., Eqs. 1 and 2),
/// but the noise of a scan's registration does not accumulate: see
/// [`ComposedMotion`](gyre_geometry::ComposedMotion).
pub fn compose(previous: Option<&PoseHeader>, motion: &MotionHeader) -> PoseHeader {
    let start = PoseHeader::default();
    let previous = previous.unwrap_or(&start);
    let next = previous.composed().then(&motion.motion.motion());
    let pose = next.motion();
    let [x_m, y_m, yaw_rad] = xy_yaw(&pose.motion);
    PoseHeader {
        item: motion.item,
        motion: motion.motion,
        x_m,
        y_m,
        yaw_rad,
        covariance: covariance::pack(&pose.covariance),
        accumulated_covariance: covariance::pack(&next.accumulated()),
        trajectory_version: previous.trajectory_version,
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use gyre_geometry::ComposedMotion;

    use super::*;
    use crate::MotionEstimate;

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

    /// Compares with `Odometry` in one process, to the bit.
    #[test]
    fn poses_are_those_of_motions_composed_without_messages() {
        let mut header: Option<PoseHeader> = None;
        let mut composed = ComposedMotion::new();
        for k in 0..1000 {
            let at = f64::from(k);
            let moves = if k % 7 == 0 { 0.0 } else { 1.0 };
            let motion = MotionEstimate {
                x_m: moves * (2.0 + (0.3 * at).sin()),
                y_m: moves * 0.1 * (0.7 * at).sin(),
                yaw_rad: moves * 0.05 * (0.05 * at).sin(),
                covariance: [4e-4, 1e-5, -2e-6, 1e-4, 3e-7, 1e-6],
                drift_share: 0.25,
                scale_sigma: 0.01,
                ..MotionEstimate::default()
            };
            let message = MotionHeader {
                motion,
                ..MotionHeader::default()
            };
            let next = compose(header.as_ref(), &message);
            composed = composed.then(&motion.motion()).normalized();
            assert_eq!(next.composed(), composed, "pose {k}");
            header = Some(next);
        }
    }
}
