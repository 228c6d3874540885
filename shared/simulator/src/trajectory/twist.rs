//! Constant velocity and turn rate.

use nalgebra::{Isometry2, Vector2};

use super::Trajectory;

/// A sensor that keeps its velocity and its turn rate, from the world's origin at time zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ConstantTwist {
    /// Metres a second ahead.
    pub forward_m_s: f64,
    /// Metres a second to the left.
    pub left_m_s: f64,
    /// Radians a second, counter-clockwise.
    pub yaw_rad_s: f64,
}

impl Trajectory for ConstantTwist {
    fn pose(&self, time_s: f64) -> Isometry2<f64> {
        let yaw = self.yaw_rad_s * time_s;
        // The exponential of a planar twist: sin(a)/a and (1 - cos(a))/a, with their limits at a = 0.
        let (along, across) = if yaw.abs() < 1e-9 {
            (1.0, 0.5 * yaw)
        } else {
            (yaw.sin() / yaw, (1.0 - yaw.cos()) / yaw)
        };
        let (x, y) = (self.forward_m_s * time_s, self.left_m_s * time_s);
        Isometry2::new(
            Vector2::new(along * x - across * y, across * x + along * y),
            yaw,
        )
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;

    #[test]
    fn constant_twist_turns_on_a_circle() {
        let twist = ConstantTwist {
            forward_m_s: 3.0,
            left_m_s: 0.0,
            yaw_rad_s: FRAC_PI_2,
        };
        let quarter = twist.pose(1.0);
        let radius = 3.0 / FRAC_PI_2;
        assert!(
            (quarter.translation.x - radius).abs() < 1e-12
                && (quarter.translation.y - radius).abs() < 1e-12
        );
        assert!((quarter.rotation.angle() - FRAC_PI_2).abs() < 1e-12);
    }
}
