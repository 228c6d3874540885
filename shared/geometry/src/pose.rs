use std::f64::consts::{PI, TAU};

use nalgebra::{Isometry2, Vector2};

/// The pose of a frame in another frame: x forward and y left in m, yaw counter-clockwise in rad.
pub type Pose = Isometry2<f64>;

pub fn pose(x_m: f64, y_m: f64, yaw_rad: f64) -> Pose {
    Pose::new(Vector2::new(x_m, y_m), yaw_rad)
}

/// Returns x and y in m, and yaw in (-pi, pi] rad.
pub fn xy_yaw(pose: &Pose) -> [f64; 3] {
    [
        pose.translation.x,
        pose.translation.y,
        pose.rotation.angle(),
    ]
}

/// Interpolates between `from` (`share` 0) and `to` (1): linearly in position, and in yaw along the
/// shorter arc.
pub fn interpolate(from: &Pose, to: &Pose, share: f64) -> Pose {
    let position = from.translation.vector.lerp(&to.translation.vector, share);
    let turn = (to.rotation * from.rotation.inverse()).angle();
    Pose::new(position, from.rotation.angle() + share * turn)
}

/// Converts between frames with y to the right and clockwise yaw, and REP-103 frames, in either
/// direction.
pub fn mirrored(pose: &Pose) -> Pose {
    let [x_m, y_m, yaw_rad] = xy_yaw(pose);
    self::pose(x_m, -y_m, -yaw_rad)
}

/// Wraps an angle to (-pi, pi], rad.
pub fn wrap_angle(angle_rad: f64) -> f64 {
    let turned = angle_rad.rem_euclid(TAU);
    if turned > PI { turned - TAU } else { turned }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interpolation_takes_the_shorter_arc_and_meets_both_ends() {
        let (from, to) = (pose(0.0, 1.0, PI - 0.1), pose(2.0, 1.0, -PI + 0.1));
        let middle = interpolate(&from, &to, 0.5);
        assert!((middle.translation.x - 1.0).abs() < 1e-12);
        assert!((middle.rotation.angle().abs() - PI).abs() < 1e-9);
        for (share, end) in [(0.0, from), (1.0, to)] {
            let there = interpolate(&from, &to, share);
            assert!((there.translation.vector - end.translation.vector).norm() < 1e-12);
            assert!(there.rotation.angle_to(&end.rotation).abs() < 1e-12);
        }
    }

    #[test]
    fn angles_wrap_to_one_turn_and_pi_stays() {
        for (angle, expected) in [
            (0.0, 0.0),
            (PI, PI),
            (-PI, PI),
            (1.5 * PI, -0.5 * PI),
            (-7.0 * PI, PI),
        ] {
            assert!((wrap_angle(angle) - expected).abs() < 1e-12, "{angle}");
        }
    }

    #[test]
    fn a_mirrored_pose_has_opposite_y_and_yaw() {
        let there = mirrored(&pose(1.0, 2.0, 0.3));
        assert_eq!(xy_yaw(&there), [1.0, -2.0, -0.3]);
        assert!((mirrored(&there).translation.y - 2.0).abs() < 1e-12);
    }
}
