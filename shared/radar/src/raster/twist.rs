//! The sensor's motion during one sweep.

use nalgebra::{Isometry2, Translation2, UnitComplex, Vector2};

/// A constant velocity in the sensor's own frame: it drives a circle, or a straight line.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Twist {
    /// Forward speed, m/s.
    pub vx_mps: f64,
    /// Speed to the left, m/s.
    pub vy_mps: f64,
    /// Turning speed, counter-clockwise, rad/s.
    pub yaw_rate_radps: f64,
}

impl Twist {
    /// The twist that takes `dt_s` seconds for `motion`, the pose of the later frame in the earlier one:
    /// its logarithm over time. Not finite if `dt_s` is zero or `motion` is not finite.
    pub fn from_motion(motion: &Isometry2<f64>, dt_s: f64) -> Self {
        let yaw = motion.rotation.angle();
        let half = 0.5 * yaw;
        // log of SE(2): the chord, turned back by half the turn, stretched to its arc.
        let stretch = 1.0 / sinc(half);
        let arc = UnitComplex::new(-half) * motion.translation.vector * (stretch / dt_s);
        Self {
            vx_mps: arc.x,
            vy_mps: arc.y,
            yaw_rate_radps: yaw / dt_s,
        }
    }

    /// The pose after `t_s` seconds in the frame at second 0: exp(twist t). Negative times are the past.
    pub fn pose_at(&self, t_s: f64) -> Isometry2<f64> {
        let half = 0.5 * self.yaw_rate_radps * t_s;
        let arc = Vector2::new(self.vx_mps, self.vy_mps) * t_s;
        let chord = UnitComplex::new(half) * arc * sinc(half);
        Isometry2::from_parts(Translation2::from(chord), UnitComplex::new(2.0 * half))
    }

    /// The same motion seen in a mirror, x forward and y right.
    pub(super) fn mirrored(&self) -> Self {
        Self {
            vx_mps: self.vx_mps,
            vy_mps: -self.vy_mps,
            yaw_rate_radps: -self.yaw_rate_radps,
        }
    }

    pub(super) fn speed_mps(&self) -> f64 {
        self.vx_mps.hypot(self.vy_mps)
    }
}

fn sinc(x: f64) -> f64 {
    if x.abs() < 1e-4 {
        1.0 - x * x / 6.0
    } else {
        x.sin() / x
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

    fn difference(a: &Isometry2<f64>, b: &Isometry2<f64>) -> f64 {
        let between = a.inverse() * b;
        between.translation.vector.norm() + between.rotation.angle().abs()
    }

    proptest! {
        #[test]
        fn logarithm_undoes_exponential(
            x in -20.0..20.0f64, y in -5.0..5.0f64, yaw in -3.1..3.1f64, dt_s in 0.05..2.0f64,
        ) {
            let motion = Isometry2::new(Vector2::new(x, y), yaw);
            let twist = Twist::from_motion(&motion, dt_s);
            prop_assert!(difference(&motion, &twist.pose_at(dt_s)) < 1e-9);
        }

        #[test]
        fn poses_compose_along_the_sweep(
            vx in -30.0..30.0f64, vy in -5.0..5.0f64, yaw_rate in -2.0..2.0f64, a in -0.5..0.5f64, b in -0.5..0.5f64,
        ) {
            let twist = Twist { vx_mps: vx, vy_mps: vy, yaw_rate_radps: yaw_rate };
            let composed = twist.pose_at(a) * twist.pose_at(b);
            prop_assert!(difference(&composed, &twist.pose_at(a + b)) < 1e-9);
        }
    }

    #[test]
    fn a_quarter_circle_is_driven_on_its_arc() {
        let radius = 10.0;
        let motion = Isometry2::new(Vector2::new(radius, radius), FRAC_PI_2);
        let twist = Twist::from_motion(&motion, 2.0);
        assert!((twist.vx_mps - radius * FRAC_PI_4).abs() < 1e-12);
        assert!(twist.vy_mps.abs() < 1e-12);
        assert!((twist.yaw_rate_radps - FRAC_PI_4).abs() < 1e-12);
    }
}
