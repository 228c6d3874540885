use gyre_geometry::xy_yaw;
use proptest::prelude::*;

use super::*;

fn distance(distance_m: f64, radar_ahead_m: f64) -> PredictedDistance {
    PredictedDistance {
        by: Witness::Wheels,
        change_m: distance_m,
        distance_m,
        left_m: 0.0,
        variance_m2: 1e-4,
        side_variance_m2: 4e-4,
        radar_ahead_m,
    }
}

proptest! {
    /// The axle that does not steer never moves sideways: many small steps of it lead to where the
    /// arc leads.
    #[test]
    fn the_motion_is_the_sum_of_steps_of_the_axle(
        distance_m in -5.0..20.0f64, yaw_rad in -1.5..1.5f64, ahead_m in -3.0..5.0f64,
    ) {
        const STEPS: usize = 10_000;
        let step = pose(distance_m / STEPS as f64, 0.0, 0.0) * pose(0.0, 0.0, yaw_rad / STEPS as f64);
        let axle = (0..STEPS).fold(Pose::identity(), |at, _| at * step);
        let radar = pose(ahead_m, 0.0, 0.0);
        let summed = xy_yaw(&(radar.inverse() * axle * radar));
        let motion = xy_yaw(&distance(distance_m, ahead_m).motion([yaw_rad, 0.0]).motion);
        for k in 0..3 {
            prop_assert!((summed[k] - motion[k]).abs() < 2e-3, "{summed:?} {motion:?}");
        }
    }

    /// The covariance matches motions whose distance and turn are off by one standard deviation.
    #[test]
    fn the_covariance_is_that_of_small_errors(
        distance_m in -5.0..20.0f64, yaw_rad in -0.5..0.5f64, ahead_m in -3.0..5.0f64,
    ) {
        const TURN_RAD: f64 = 1e-3;
        let predicted = distance(distance_m, ahead_m);
        let whole = predicted.motion([yaw_rad, TURN_RAD * TURN_RAD]);
        let off = |other: PredictedDistance, turn_rad: f64| {
            let moved = xy_yaw(&other.motion([yaw_rad + turn_rad, 0.0]).motion);
            Vector3::from(moved) - Vector3::from(xy_yaw(&whole.motion))
        };
        let longer = PredictedDistance { distance_m: distance_m + 1e-2, ..predicted };
        let (sin, cos) = (0.5 * yaw_rad).sin_cos();
        let across = Vector3::new(-sin, cos, 0.0) * 2e-2;
        let errors = [off(longer, 0.0), off(predicted, TURN_RAD), across];
        let expected: Matrix3<f64> = errors.iter().map(|it| it * it.transpose()).sum();
        // The chord of a bend is a little shorter than its arc.
        let apart = (whole.covariance - expected).norm();
        prop_assert!(apart < 0.05 * expected.norm(), "{} {expected}", whole.covariance);
        prop_assert!(whole.covariance.cholesky().is_some());
    }
}
