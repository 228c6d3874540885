use gyre_geometry::xy_yaw;
use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::*;

/// Standard deviation of the place of a registered pose, m.
const NOISE_M: f64 = 0.04;
const DRIFT_SHARE: f64 = 0.1;
const INTERVAL_S: f64 = 0.25;

/// A drive with the errors that the filter assumes.
struct Drive {
    rng: ChaCha8Rng,
    config: WheelsConfig,
    wheels: WheelState,
    true_scale: f64,
    /// Places along the path against the map: the true one, and the last scan's.
    true_m: f64,
    at_m: f64,
}

impl Drive {
    fn new(seed: u64) -> Self {
        let config = WheelsConfig::default();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let off: f64 = rng.sample(StandardNormal);
        Self {
            rng,
            wheels: WheelState::new(&config),
            true_scale: 1.0 + off * config.scale_sigma,
            config,
            true_m: 0.0,
            at_m: 0.0,
        }
    }

    fn normal(&mut self, sigma: f64) -> f64 {
        sigma * self.rng.sample::<f64, _>(StandardNormal)
    }

    /// Drives so far, while the wheels show another distance by `slip_m`.
    fn drive(&mut self, step_m: f64, slip_m: f64) -> WheelDistance {
        let walk = SCALE_WALK_PER_SQRT_S * INTERVAL_S.sqrt();
        self.true_scale += self.normal(walk);
        self.wheels.wait(INTERVAL_S);
        self.true_m += step_m;
        let variance_m2 = 1e-4 * step_m.abs() + 2.5e-5;
        let noise_m = self.normal(variance_m2.sqrt());
        WheelDistance {
            distance_m: (step_m + noise_m) / self.true_scale + slip_m,
            variance_m2,
            side_variance_m2: 0.0,
            interval_s: INTERVAL_S,
        }
    }

    /// Registers the scan, with a map that drifts; returns the registered distance.
    fn register(&mut self) -> Registered {
        let drift_m2 = 2.0 * NOISE_M * NOISE_M * DRIFT_SHARE / (1.0 - DRIFT_SHARE);
        let drift_m = self.normal(drift_m2.sqrt());
        // All poses of the map drift.
        self.true_m -= drift_m;
        let noise_m = self.normal(NOISE_M);
        let distance_m = self.true_m + noise_m - self.at_m;
        self.at_m += distance_m;
        Registered {
            distance_m,
            variance_m2: 2.0 * NOISE_M * NOISE_M + drift_m2,
            drift_share: DRIFT_SHARE,
        }
    }

    /// Drives so far with a certain match; returns whether the wheels agree with it.
    fn step(&mut self, step_m: f64) -> bool {
        self.slipping_step(step_m, 0.0)
    }

    fn slipping_step(&mut self, step_m: f64, slip_m: f64) -> bool {
        let measured = self.drive(step_m, slip_m);
        let registered = self.register();
        self.wheels
            .update(Some(&measured), &registered, true, &self.config);
        !self.wheels.slips
    }

    fn steps(&mut self, scans: u32) {
        for _ in 0..scans {
            self.step(2.5);
        }
    }

    fn blind(&mut self, step_m: f64) {
        let measured = self.drive(step_m, 0.0);
        let predicted = self.wheels.predict(&measured, &self.config);
        let predicted = predicted.expect("no slip");
        self.at_m += predicted.distance_m;
        self.wheels.dead_reckon(&measured);
        let motion = predicted.motion([0.0, 0.0]);
        self.wheels.add_unmatched(&motion, INTERVAL_S);
    }

    /// The squared error of offset and scale over their covariance.
    fn nees(&self) -> f64 {
        let wheels = &self.wheels;
        let off = Vector2::new(
            self.at_m - self.true_m - wheels.offset_m,
            self.true_scale - wheels.scale,
        );
        let inverse = wheels.covariance.try_inverse().expect("a covariance");
        (off.transpose() * inverse * off)[0] / 2.0
    }
}

#[test]
fn the_scale_is_learnt_with_its_covariance_through_times_without_a_match() {
    const DRIVES: u64 = 300;
    let (mut seen, mut blind, mut off, mut rejected) = (0.0, 0.0, 0.0, 0);
    for seed in 0..DRIVES {
        let mut drive = Drive::new(seed);
        for _ in 0..60 {
            let step_m = drive.rng.random_range(-1.0..4.0);
            rejected += usize::from(!drive.step(step_m));
        }
        seen += drive.nees() / DRIVES as f64;
        (0..20).for_each(|_| drive.blind(2.5));
        blind += drive.nees() / DRIVES as f64;
        (0..60).for_each(|_| rejected += usize::from(!drive.step(2.5)));
        off += (drive.true_scale - drive.wheels.scale).powi(2) / DRIVES as f64;
    }
    assert!(
        (0.8..1.25).contains(&seen) && (0.8..1.25).contains(&blind),
        "{seen} {blind}"
    );
    // 200 m that are registered to 6 cm at their ends: a thousandth or less.
    assert!(off.sqrt() < 1.5e-3, "{}", off.sqrt());
    assert!(
        rejected <= 8,
        "{rejected} of 36 000 by four standard deviations"
    );
}

#[test]
fn wheels_that_slip_are_not_used_until_they_agree_again() {
    let mut drive = Drive::new(3);
    drive.steps(40);
    let scale = drive.wheels.scale;
    assert!(!drive.slipping_step(2.5, 0.8));
    let measured = drive.drive(0.0, 0.0);
    assert!(drive.wheels.predict(&measured, &drive.config).is_none());
    assert_eq!(drive.wheels.scale, scale);
    assert!(drive.step(2.5));
    assert!(drive.wheels.predict(&measured, &drive.config).is_some());
}

/// Wheels that turn 30 % too fast while the vehicle pulls away: each motion alone is within the
/// noise of a match.
#[test]
fn wheels_that_slip_from_the_first_metre_are_noticed_and_their_scale_is_learnt_again() {
    for seed in 0..100 {
        let mut drive = Drive::new(seed);
        let steps = (1..=30).map(|scan| 0.03 * f64::from(scan));
        let refused = steps.filter(|step_m| !drive.slipping_step(*step_m, 0.3 * step_m));
        assert!(refused.count() > 0, "{seed}");
        drive.steps(20);
        let off = (drive.wheels.scale - drive.true_scale).abs();
        assert!(off < 0.01, "{seed}: {off}");
    }
}

/// A tachometer that shows 11 % too much, contrary to the settings, is not learnt in silence.
#[test]
fn wheels_of_another_scale_than_the_settings_allow_slip_again_and_again() {
    for seed in 0..100 {
        let mut drive = Drive::new(seed);
        drive.true_scale = 0.9;
        let refused = (0..100).filter(|_| !drive.step(2.5)).count();
        assert!(refused > 30, "{seed}: {refused}");
    }
}

#[test]
fn a_new_map_starts_where_the_last_scan_is() {
    let mut drive = Drive::new(5);
    drive.steps(20);
    drive.blind(2.5);
    drive.wheels.start_map();
    assert_eq!(drive.wheels.offset_m, 0.0);
    assert_eq!(drive.wheels.covariance[(0, 0)], 0.0);
    assert!(drive.wheels.covariance[(1, 1)] > 0.0 && drive.wheels.since_match_m > 2.0);
}

fn distance(distance_m: f64, radar_ahead_m: f64) -> PredictedDistance {
    PredictedDistance {
        by: DistanceBy::Wheels,
        distance_m,
        left_m: 0.0,
        variance_m2: 1e-4,
        side_variance_m2: 4e-4,
        radar_ahead_m,
        since_match: [0.0; 2],
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
