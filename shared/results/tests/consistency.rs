//! NEES and error bands of motions whose covariance is known.

use gyre_geometry::{OdometryMotion, Pose, UncertainMotion, pose};
use gyre_radar::Trajectory;
use gyre_results::evaluation::{
    MatchedMotions, Nees, NeesFigure, NeesFigures, NeesOptions, TimedMotion, TruthSigma, bands,
    nees, plot::bands_svg,
};
use nalgebra::{Matrix3, Vector3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const INTERVAL_NS: i64 = 250_000_000;

/// Correlated, and small enough for a first-order composition of 64 motions.
fn covariance() -> Matrix3<f64> {
    let spread = Matrix3::new(0.02, 0.0, 0.0, 0.006, 0.03, 0.0, 1e-4, -4e-4, 8e-4);
    spread * spread.transpose()
}

fn gaussian(random: &mut impl Rng) -> Vector3<f64> {
    let mut draw = || {
        let radius = (-2.0 * (1.0 - random.random::<f64>()).ln()).sqrt();
        radius * (std::f64::consts::TAU * random.random::<f64>()).cos()
    };
    Vector3::new(draw(), draw(), draw())
}

/// A pose with an error of (x, y, yaw) along the axes of its reference frame.
fn disturbed(truth: &Pose, error: Vector3<f64>) -> Pose {
    let (at, yaw_rad) = (&truth.translation, truth.rotation.angle());
    pose(at.x + error.x, at.y + error.y, yaw_rad + error.z)
}

/// A winding drive and its motions with errors drawn from `covariance()`.
struct Drive {
    truth: Trajectory,
    motions: Vec<TimedMotion>,
}

impl Drive {
    fn new(motions: usize, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let truth = crate::common::drive(motions, 90.0);
        let stamps_ns: Vec<_> = (0..truth.len() as i64).map(|k| k * INTERVAL_NS).collect();
        let spread = covariance().cholesky().unwrap().l();
        let motion = |k: usize| {
            let error = spread * gaussian(&mut random);
            let motion = disturbed(&truth[k].inv_mul(&truth[k + 1]), error);
            let estimate = UncertainMotion {
                motion,
                covariance: covariance(),
            };
            TimedMotion {
                from_ns: stamps_ns[k],
                to_ns: stamps_ns[k + 1],
                estimate: OdometryMotion::independent(estimate),
            }
        };
        let motions = (0..motions).map(motion).collect();
        let truth = Trajectory::timed(stamps_ns, truth);
        Self { truth, motions }
    }

    fn matched(&self) -> MatchedMotions {
        MatchedMotions::new(&self.motions, &self.truth, INTERVAL_NS).unwrap()
    }

    fn nees(&self) -> Nees {
        nees(&self.matched(), &NeesOptions::default())
    }
}

/// Pose, translation and yaw.
fn parts(figures: &NeesFigures) -> [NeesFigure; 3] {
    [figures.pose, figures.translation, figures.yaw]
}

#[test]
fn true_covariances_pass_the_acceptance_interval_95_times_in_100() {
    let (drives, mut accepted) = (400, [[0; 3]; 4]);
    for seed in 0..drives {
        let nees = Drive::new(640, seed).nees();
        for (length, accepted) in nees.by_length.iter().zip(&mut accepted) {
            for (figure, accepted) in parts(&length.all).iter().zip(accepted) {
                let [low, high] = figure.acceptance_interval;
                *accepted += usize::from(low < figure.ratio && figure.ratio < high);
            }
        }
    }
    let is_right = |count: &usize| (368..392).contains(count);
    let are_right = accepted.iter().flatten().all(is_right);
    assert!(are_right, "{accepted:?} of 400");
}

#[test]
fn true_covariances_have_a_ratio_of_one_in_each_half_of_a_long_drive() {
    let nees = Drive::new(12_800, 7).nees();
    let lengths = nees.by_length.iter();
    let segments = lengths.map(|it| (it.motions, it.all.segments));
    let expected = [(1, 12_800), (4, 3_200), (16, 800), (64, 200)];
    assert_eq!(segments.collect::<Vec<_>>(), expected);
    let single = &nees.by_length[0];
    let halves = [&single.first_half, &single.second_half].map(|it| it.as_ref().unwrap());
    for figure in [&single.all, halves[0], halves[1]]
        .into_iter()
        .flat_map(parts)
    {
        assert!((figure.ratio - 1.0).abs() < 0.05, "{nees}");
        assert!((figure.outside_percent - 5.0).abs() < 1.0, "{nees}");
    }
}

/// The poses drift, and each has additional noise of its own, as poses of scans that are registered
/// with a map.
#[test]
fn motions_that_share_the_noise_of_their_poses_are_consistent_over_all_lengths() {
    const DRIFT_SHARE: f64 = 0.05;
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let mut drive = Drive::new(12_800, 7);
    let spread = covariance().cholesky().unwrap().l();
    let mut draw = |share: f64| spread * gaussian(&mut random) * share.sqrt();
    let (mut drifted, mut last) = (drive.truth.poses[0], drive.truth.poses[0]);
    for (k, motion) in drive.motions.iter_mut().enumerate() {
        let step = drive.truth.poses[k].inv_mul(&drive.truth.poses[k + 1]);
        drifted *= disturbed(&step, draw(DRIFT_SHARE));
        let noisy = drifted * disturbed(&Pose::identity(), draw(0.5 * (1.0 - DRIFT_SHARE)));
        motion.estimate.motion = last.inv_mul(&noisy);
        motion.estimate.drift_share = DRIFT_SHARE;
        last = noisy;
    }
    let nees = drive.nees();
    for length in &nees.by_length {
        assert!((length.all.pose.ratio - 1.0).abs() < 0.15, "{nees}");
    }
    let mut independent = drive;
    for motion in &mut independent.motions {
        motion.estimate.drift_share = 1.0;
    }
    let nees = independent.nees();
    assert!(nees.by_length[3].all.pose.ratio < 0.2, "{nees}");
}

#[test]
fn the_noise_of_the_ground_truth_is_accounted_for() {
    let mut drive = Drive::new(6_400, 5);
    let sigma = TruthSigma {
        position_m: 0.1,
        yaw_rad: 0.004,
    };
    let scale = Vector3::new(sigma.position_m, sigma.position_m, sigma.yaw_rad);
    let mut random = ChaCha8Rng::seed_from_u64(6);
    for truth in &mut drive.truth.poses {
        *truth = disturbed(truth, gaussian(&mut random).component_mul(&scale));
    }
    let matched = drive.matched();
    let mut options = NeesOptions::default();
    assert!(nees(&matched, &options).by_length[0].all.pose.ratio > 5.0);
    options.truth_sigma = sigma;
    let with_sigma = nees(&matched, &options);
    for length in &with_sigma.by_length {
        // Adjoining segments share a ground-truth pose, so the ratio varies a little more than the
        // interval.
        assert!((length.all.pose.ratio - 1.0).abs() < 0.15, "{with_sigma}");
    }
}

#[test]
fn three_sigma_bands_contain_the_errors_of_true_covariances() {
    let mut inside = [0.0; 3];
    let drives = 300;
    for seed in 0..drives {
        let bands = bands(&Drive::new(100, seed).matched(), TruthSigma::default());
        let share = bands.inside_percent(3.0);
        inside = [0, 1, 2].map(|part| inside[part] + share[part] / drives as f64);
    }
    let is_right = |share: &f64| (99.2..99.95).contains(share);
    assert!(inside.iter().all(is_right), "{inside:?}");
}

#[test]
fn sigma_starts_at_zero_and_that_of_yaw_grows_with_the_root_of_time() {
    let bands = bands(&Drive::new(100, 1).matched(), TruthSigma::default());
    let samples = &bands.chains[0];
    let zero = Vector3::zeros();
    assert_eq!(
        (samples.len(), samples[0].sigma, samples[0].error),
        (101, zero, zero)
    );
    assert_eq!(samples[100].time_s, 25.0);
    assert!((samples[100].sigma.z / covariance()[(2, 2)].sqrt() - 10.0).abs() < 1e-9);
}

#[test]
fn bands_are_drawn_for_every_chain() {
    let mut drive = Drive::new(40, 1);
    drive.motions.remove(20);
    let svg = bands_svg(&bands(&drive.matched(), TruthSigma::default())).unwrap();
    for label in ["x (m)", "y (m)", "yaw (deg)", "time (s)", "+-3 sigma"] {
        assert!(svg.contains(label), "{label}");
    }
    assert_eq!(svg.matches("<polygon").count(), 6);
}
