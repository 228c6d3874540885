use nalgebra::{Rotation2, Translation2, UnitComplex, Vector2};
use serde::{Deserialize, Serialize};

use crate::Pose;

/// A constant velocity in the moving frame: motion along a circular arc or a straight line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Twist {
    pub vx_mps: f64,
    pub vy_mps: f64,
    /// Yaw rate, counter-clockwise, rad/s.
    pub yaw_rate_radps: f64,
}

impl From<[f64; 3]> for Twist {
    /// From x and y, m/s, and yaw, rad/s.
    fn from([vx_mps, vy_mps, yaw_rate_radps]: [f64; 3]) -> Self {
        Self {
            vx_mps,
            vy_mps,
            yaw_rate_radps,
        }
    }
}

impl Twist {
    /// Returns the twist of `motion` (the pose of the later frame in the earlier one) over `dt_s`
    /// seconds: the logarithm divided by the time. It is not finite if `dt_s` is zero or `motion`
    /// is not finite.
    pub fn from_motion(motion: &Pose, dt_s: f64) -> Self {
        let yaw = motion.rotation.angle();
        let half = 0.5 * yaw;
        // The logarithm of SE(2): the chord, rotated back by half the yaw and scaled to the length
        // of the arc.
        let stretch = 1.0 / sinc(half);
        let arc = UnitComplex::new(-half) * motion.translation.vector * (stretch / dt_s);
        [arc.x, arc.y, yaw / dt_s].into()
    }

    /// Returns the pose after `t_s` seconds in the frame at time 0: exp(twist t). Negative times
    /// are in the past.
    pub fn pose_at(&self, t_s: f64) -> Pose {
        let half = 0.5 * self.yaw_rate_radps * t_s;
        let arc = self.linear_mps() * t_s;
        let chord = UnitComplex::new(half) * arc * sinc(half);
        Pose::from_parts(Translation2::from(chord), UnitComplex::new(2.0 * half))
    }

    /// As [`Twist::from_motion`] with the chord instead of the arc, which underestimates the speed
    /// by a factor of yaw squared over
    /// 24. The refinement uses this form throughout, as its kernel for single points does.
    pub fn from_chord(motion: &Pose, dt_s: f64) -> Self {
        let yaw = motion.rotation.angle();
        let along = Rotation2::new(-0.5 * yaw) * motion.translation.vector;
        Self {
            vx_mps: along.x / dt_s,
            vy_mps: along.y / dt_s,
            yaw_rate_radps: yaw / dt_s,
        }
    }

    /// Returns the pose after `t_s` seconds if the chord is as long as the arc; the inverse of
    /// [`Twist::from_chord`].
    pub fn chord_pose_at(&self, t_s: f64) -> Pose {
        let yaw = self.yaw_rate_radps * t_s;
        Pose::new(Rotation2::new(0.5 * yaw) * self.linear_mps() * t_s, yaw)
    }

    pub fn linear_mps(&self) -> Vector2<f64> {
        Vector2::new(self.vx_mps, self.vy_mps)
    }

    pub fn speed_mps(&self) -> f64 {
        self.vx_mps.hypot(self.vy_mps)
    }

    /// Converts to frames with y to the right and clockwise yaw, or back.
    pub fn mirrored(&self) -> Self {
        Self {
            vx_mps: self.vx_mps,
            vy_mps: -self.vy_mps,
            yaw_rate_radps: -self.yaw_rate_radps,
        }
    }

    pub fn lerp(&self, other: &Self, share: f64) -> Self {
        let between = |a: f64, b: f64| a * (1.0 - share) + b * share;
        Self {
            vx_mps: between(self.vx_mps, other.vx_mps),
            vy_mps: between(self.vy_mps, other.vy_mps),
            yaw_rate_radps: between(self.yaw_rate_radps, other.yaw_rate_radps),
        }
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
    use crate::pose;
    use proptest::prelude::*;

    fn difference(a: &Pose, b: &Pose) -> f64 {
        let between = a.inverse() * b;
        between.translation.vector.norm() + between.rotation.angle().abs()
    }

    proptest! {
        #[test]
        fn the_logarithm_is_the_inverse_of_the_exponential(
            x in -20.0..20.0f64, y in -5.0..5.0f64, yaw in -3.1..3.1f64, dt_s in 0.05..2.0f64,
        ) {
            let motion = pose(x, y, yaw);
            prop_assert!(difference(&motion, &Twist::from_motion(&motion, dt_s).pose_at(dt_s)) < 1e-9);
            prop_assert!(difference(&motion, &Twist::from_chord(&motion, dt_s).chord_pose_at(dt_s)) < 1e-9);
        }

        #[test]
        fn poses_compose_along_the_arc(
            vx in -30.0..30.0f64, vy in -5.0..5.0f64, rate in -2.0..2.0f64, a in -0.5..0.5f64, b in -0.5..0.5f64,
        ) {
            let twist = Twist { vx_mps: vx, vy_mps: vy, yaw_rate_radps: rate };
            prop_assert!(difference(&(twist.pose_at(a) * twist.pose_at(b)), &twist.pose_at(a + b)) < 1e-9);
        }

        #[test]
        fn chord_and_arc_differ_by_yaw_squared_over_24(
            vx in 1.0..30.0f64, rate in -1.0..1.0f64, t_s in 0.05..0.5f64,
        ) {
            let twist = Twist { vx_mps: vx, vy_mps: 0.0, yaw_rate_radps: rate };
            let excess = twist.chord_pose_at(t_s).translation.vector.norm()
                - twist.pose_at(t_s).translation.vector.norm();
            let turn = rate * t_s;
            prop_assert!((excess - vx * t_s * turn * turn / 24.0).abs() < 1e-3 * vx * t_s * turn * turn + 1e-9);
        }
    }
}
