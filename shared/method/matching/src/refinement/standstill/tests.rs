//! A simulated stop and go, and single steps of it.

use gyre_geometry::pose;
use nalgebra::{Matrix3, Vector3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::*;

const INTERVAL_S: f64 = 0.25;
/// Standard deviations of an estimate: x, y (m), yaw (rad).
const SIGMA: [f64; 3] = [0.055, 0.055, 0.0035];

struct Drive {
    standstill: Standstill,
    rng: ChaCha8Rng,
    /// Standard deviation of the jitter relative to the covariances.
    jitter: f64,
    true_m: f64,
    estimate: Pose,
    reported: Pose,
    path_m: f64,
}

struct Step {
    stationary: bool,
    /// Distance of the reported pose from the estimated one.
    lag_m: f64,
}

impl Drive {
    fn with_jitter(jitter: f64) -> Self {
        Self {
            standstill: Standstill::default(),
            rng: ChaCha8Rng::seed_from_u64(1),
            jitter,
            true_m: 0.0,
            estimate: Pose::identity(),
            reported: Pose::identity(),
            path_m: 0.0,
        }
    }

    /// Drives for so many scans at a speed that changes evenly between two, m/s.
    fn drive(&mut self, scans: usize, [from, to]: [f64; 2]) -> Vec<Step> {
        (0..scans)
            .map(|k| {
                let share = (k as f64 + 0.5) / scans as f64;
                self.true_m += (from + share * (to - from)) * INTERVAL_S;
                self.step(Outcome::Refined, 0.0)
            })
            .collect()
    }

    fn step(&mut self, outcome: Outcome, off_m: f64) -> Step {
        let mut error =
            |sigma: f64| sigma * self.jitter * self.rng.sample::<f64, _>(StandardNormal);
        let [x_m, y_m, yaw_rad] = SIGMA.map(&mut error);
        let previous = self.estimate;
        self.estimate = pose(self.true_m + x_m + off_m, y_m, yaw_rad);
        let variances = Vector3::from(SIGMA.map(|sigma| sigma * sigma));
        let report = self.standstill.next(&Estimate {
            moves: false,
            pose: UncertainMotion {
                motion: self.estimate,
                covariance: Matrix3::from_diagonal(&variances),
            },
            covariance: Matrix3::from_diagonal(&variances),
            previous,
            outcome,
            interval_s: INTERVAL_S,
        });
        let motion = report.motion.motion;
        self.reported *= motion;
        self.path_m += motion.translation.vector.norm();
        Step {
            stationary: report.stationary,
            lag_m: (self.reported.translation.vector - self.estimate.translation.vector).norm(),
        }
    }
}

fn stationary(steps: &[Step]) -> usize {
    steps.iter().filter(|step| step.stationary).count()
}

#[test]
fn jitter_does_not_add_up_while_the_vehicle_stands() {
    for jitter in [0.1, 0.5, 1.0] {
        let mut drive = Drive::with_jitter(jitter);
        drive.drive(20, [8.0, 8.0]);
        drive.drive(16, [8.0, 0.0]);
        let driven_m = drive.path_m;
        let steps = drive.drive(400, [0.0, 0.0]);
        assert!(
            stationary(&steps) >= 388,
            "{jitter}: {}",
            stationary(&steps)
        );
        let path_m = drive.path_m - driven_m;
        assert!(path_m < 1.0, "{jitter}: {path_m} m");
    }
}

#[test]
fn nothing_of_a_creep_is_lost() {
    for jitter in [0.1, 1.0] {
        let mut drive = Drive::with_jitter(jitter);
        drive.drive(80, [0.0, 0.0]);
        drive.drive(200, [0.2, 0.2]);
        drive.drive(80, [0.0, 0.0]);
        let reported_m = drive.reported.translation.x;
        assert!((reported_m - 10.0).abs() < 0.25, "{jitter}: {reported_m} m");
    }
}

#[test]
fn a_vehicle_that_drives_off_is_not_held_back() {
    for (jitter, max_lag_m) in [(0.2, 0.13), (1.0, 0.5)] {
        let mut drive = Drive::with_jitter(jitter);
        drive.drive(80, [0.0, 0.0]);
        let steps = drive.drive(20, [0.0, 10.0]);
        let held = stationary(&steps);
        assert!(held <= 2, "{jitter}: {held} scans");
        assert!(steps.iter().all(|step| step.lag_m < max_lag_m), "{jitter}");
        assert!(steps[held..].iter().all(|step| step.lag_m < 1e-9));
    }
}

#[test]
fn a_slow_drive_is_no_standstill() {
    for jitter in [0.2, 1.0] {
        let mut drive = Drive::with_jitter(jitter);
        drive.drive(20, [4.0, 4.0]);
        drive.drive(8, [4.0, 0.5]);
        let steps = drive.drive(400, [0.5, 0.5]);
        assert!(stationary(&steps) <= 2, "{jitter}: {}", stationary(&steps));
    }
}

#[test]
fn predictions_neither_begin_nor_end_a_standstill() {
    let mut drive = Drive::with_jitter(0.0);
    drive.drive(80, [0.0, 0.0]);
    for _ in 0..8 {
        drive.step(Outcome::Predicted, 5.0);
    }
    assert!(drive.standstill.stands());
    drive.drive(8, [5.0, 5.0]);
    assert!(!drive.standstill.stands());
    for _ in 0..8 {
        drive.step(Outcome::Predicted, 0.0);
    }
    assert!(!drive.standstill.stands());
}

/// Nobody sees that it still stands; the gyro, for one, sees that it does not.
#[test]
fn a_standing_vehicle_that_is_not_seen_is_as_uncertain_as_its_prediction() {
    let mut drive = Drive::with_jitter(0.0);
    drive.drive(80, [0.0, 0.0]);
    let mut estimate = Estimate {
        moves: false,
        pose: UncertainMotion {
            motion: pose(0.0, 0.0, 0.1),
            covariance: Matrix3::identity(),
        },
        covariance: Matrix3::identity(),
        previous: drive.estimate,
        outcome: Outcome::Predicted,
        interval_s: INTERVAL_S,
    };
    let held = drive.standstill.next(&estimate);
    assert!(held.stationary && held.motion.covariance == Matrix3::identity());
    estimate.moves = true;
    let moved = drive.standstill.next(&estimate);
    assert!(!moved.stationary && (moved.motion.motion.rotation.angle() - 0.1).abs() < 1e-9);
}

#[test]
fn motions_of_a_moving_vehicle_are_the_estimates_to_the_bit() {
    let mut drive = Drive::with_jitter(1.0);
    drive.drive(4, [8.0, 8.0]);
    let (before, reported) = (drive.estimate, drive.reported);
    drive.drive(1, [8.0, 8.0]);
    let motion = before.inv_mul(&drive.estimate);
    assert_eq!(drive.reported, reported * motion);
    assert_eq!(drive.standstill.reported, drive.estimate);
}

/// The squared errors of the reported motions over their variances, on average.
#[test]
fn covariances_describe_a_stop_and_go() {
    let (mut sum, mut count) = (0.0, 0);
    let mut drive = Drive::with_jitter(1.0);
    let mut add = |drive: &mut Drive, scans: usize, speeds: [f64; 2]| {
        for k in 0..scans {
            let share = |k: usize| speeds[0] + k as f64 / scans as f64 * (speeds[1] - speeds[0]);
            let (before, from_m) = (drive.standstill, drive.true_m);
            drive.true_m += share(k) * INTERVAL_S;
            let at = drive.reported.translation.x;
            drive.step(Outcome::Refined, 0.0);
            let error = drive.reported.translation.x - at - (drive.true_m - from_m);
            let factor = drive.standstill.covariance_factor(&before);
            sum += error * error / (factor * SIGMA[0] * SIGMA[0]);
            count += 1;
        }
    };
    for _ in 0..20 {
        add(&mut drive, 10, [0.0, 5.0]);
        add(&mut drive, 40, [5.0, 5.0]);
        add(&mut drive, 10, [5.0, 0.0]);
        add(&mut drive, 120, [0.0, 0.0]);
    }
    let mean = sum / f64::from(count);
    assert!((0.3..3.0).contains(&mean), "{mean}");
}

/// The heading of a gyro is better than the headings of the estimates, which are compared.
#[test]
fn the_noise_of_the_estimates_decides_and_not_the_covariance_of_the_reported_motion() {
    let variances = Vector3::from(SIGMA.map(|sigma| sigma * sigma));
    let held = Standstill::default().next(&Estimate {
        moves: false,
        pose: UncertainMotion {
            motion: pose(0.0, 0.0, 2.0 * SIGMA[2]),
            covariance: Matrix3::from_diagonal(&variances),
        },
        covariance: Matrix3::identity() * 1e-12,
        previous: Pose::identity(),
        outcome: Outcome::Refined,
        interval_s: INTERVAL_S,
    });
    assert!(held.stationary && held.motion.covariance.norm() < 1e-10);
}
