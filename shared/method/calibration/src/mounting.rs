//! The mounting of the radar: its yaw, and its distance ahead of the axle that does not slip.

use gyre_geometry::Twist;
use nalgebra::{Matrix2, Vector2};

use crate::{BLOCKS, Estimate, jackknife};

/// Slower scans contribute little, m/s.
const MIN_SPEED_MPS: f64 = 3.0;
/// Directions of motion farther from straight ahead are no driving, rad.
const MAX_SLIP_RAD: f64 = 0.5;
const MIN_SCANS: usize = 30;

/// The mounting of the radar, from the direction of motion in its frame: yaw + curvature x distance
/// ahead of the rear axle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mounting {
    /// The yaw of the radar's straight ahead in the vehicle's frame, counter-clockwise, rad.
    pub yaw_rad: Estimate,
    /// Distance of the radar ahead of the axle that does not slip, m.
    pub ahead_m: Estimate,
}

impl Mounting {
    /// Estimates the mounting from the velocities at the scans; `None` if too few scans drive, or
    /// none turns.
    pub fn of(twists: &[Twist]) -> Option<Self> {
        let rows: Vec<[f64; 2]> = twists
            .iter()
            .filter(|twist| twist.speed_mps() > MIN_SPEED_MPS)
            .map(|it| {
                [
                    it.yaw_rate_radps / it.speed_mps(),
                    it.vy_mps.atan2(it.vx_mps),
                ]
            })
            .filter(|[_, slip_rad]| slip_rad.abs() < MAX_SLIP_RAD)
            .collect();
        let count = rows.len();
        if count < MIN_SCANS {
            return None;
        }
        let [slip_rad, ahead_m] = jackknife(|left_out| {
            let rows = rows.iter().enumerate();
            fit(rows.filter(|(k, _)| Some(k * BLOCKS / count) != left_out))
        })?;
        // The vehicle's straight ahead lies at the fitted direction in the radar's frame.
        let yaw_rad = Estimate::new(-slip_rad.value, slip_rad.sigma);
        Some(Self { yaw_rad, ahead_m })
    }
}

/// The least-squares line through (curvature, direction).
fn fit<'a>(rows: impl Iterator<Item = (usize, &'a [f64; 2])>) -> Option<Vector2<f64>> {
    let (mut normal, mut side) = (Matrix2::zeros(), Vector2::zeros());
    for (_, [curvature, slip_rad]) in rows {
        let row = Vector2::new(1.0, *curvature);
        normal += row * row.transpose();
        side += row * *slip_rad;
    }
    normal.try_inverse().map(|inverse| inverse * side)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_radar_ahead_of_the_axle_and_turned_to_the_left_is_found_so() {
        let (yaw_rad, ahead_m, speed_mps) = (0.04, 2.5, 8.0);
        let twist = |k: usize| {
            let rate = 0.2 * (0.3 * k as f64).sin();
            let slip = ahead_m * rate / speed_mps - yaw_rad;
            Twist {
                vx_mps: speed_mps * slip.cos(),
                vy_mps: speed_mps * slip.sin(),
                yaw_rate_radps: rate,
            }
        };
        let twists: Vec<Twist> = (0..200).map(twist).collect();
        let found = Mounting::of(&twists).unwrap();
        assert!((found.yaw_rad.value - yaw_rad).abs() < 1e-4, "{found:?}");
        assert!((found.ahead_m.value - ahead_m).abs() < 0.01, "{found:?}");
        assert_eq!(Mounting::of(&twists[..10]), None);
    }
}
