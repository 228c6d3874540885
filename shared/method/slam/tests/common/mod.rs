//! A drive several times around a block with scattered reflectors, seen from each keyframe; and
//! what all tests use.

use std::{f64::consts::TAU, fmt::Display};

use gyre_geometry::{Pose, SparsePoint, UncertainMotion, pose};
use gyre_slam::Keyframe;
use nalgebra::{Matrix3, Point2, Vector3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

/// Keyframes of a round, which is 120 m long.
pub const AROUND: usize = 60;
const STEP_M: f64 = 2.0;
/// Standard deviations of a motion.
const SIGMA: [f64; 3] = [0.03, 0.03, 0.002];

/// Asserts that something is refused in a sentence with these words.
#[track_caller]
pub fn assert_refused<T>(result: Result<T, impl Display>, words: &str) {
    let sentence = result.err().map(|error| error.to_string());
    let is_it = sentence.as_ref().is_some_and(|it| it.contains(words));
    assert!(is_it, "{words:?} is not in {sentence:?}");
}

/// The keyframes of a path by odometry, whose motions have these standard deviations; the points
/// are drawn after each motion.
pub fn reckoned(
    truth: &[Pose],
    sigma: [f64; 3],
    random: &mut ChaCha8Rng,
    mut points: impl FnMut(&Pose, &mut ChaCha8Rng) -> Vec<SparsePoint>,
) -> Vec<Keyframe> {
    let covariance = Matrix3::from_diagonal(&Vector3::from(sigma.map(|sigma| sigma * sigma)));
    let (mut reckoned, mut motion) = (UncertainMotion::identity(), UncertainMotion::identity());
    let mut keyframe = |k: usize| {
        if k > 0 {
            let [x, y, yaw] = sigma.map(|sigma| Normal::new(0.0, sigma).unwrap().sample(random));
            let exact = truth[k - 1].inv_mul(&truth[k]);
            let measured = pose(x, y, 0.0) * exact * pose(0.0, 0.0, yaw);
            motion = UncertainMotion {
                motion: measured,
                covariance,
            };
        }
        reckoned = reckoned.then(&motion).normalized();
        let points = points(&truth[k], random);
        Keyframe {
            stamp_ns: k as i64 * 1_000_000_000,
            motion: motion.normalized(),
            path_m: STEP_M * k as f64,
            ..Keyframe::standing(4 * k as u64, reckoned, points)
        }
    };
    (0..truth.len()).map(&mut keyframe).collect()
}

pub struct Drive {
    pub truth: Vec<Pose>,
    pub keyframes: Vec<Keyframe>,
}

impl Drive {
    pub fn new(keyframes: usize, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let turn = pose(STEP_M, 0.0, TAU / AROUND as f64);
        let mut truth = vec![Pose::identity()];
        while truth.len() < keyframes {
            truth.push(truth[truth.len() - 1] * turn);
        }
        let reflectors: Vec<Point2<f64>> = (0..400)
            .map(|_| {
                Point2::new(
                    random.random_range(-80.0..80.0),
                    random.random_range(-60.0..100.0),
                )
            })
            .collect();
        let points = |here: &Pose, random: &mut ChaCha8Rng| {
            let seen = reflectors.iter().map(|at| here.inverse() * at);
            let measured = seen.filter(|at| at.coords.norm() < 75.0).map(|at| {
                let mut noise = || random.random_range(-0.05..0.05);
                let (x, y) = (at.x + noise(), at.y + noise());
                SparsePoint::from([x as f32, y as f32, 0.0, 0.8, 0.0])
            });
            measured.collect()
        };
        let keyframes = reckoned(&truth, SIGMA, &mut random, points);
        Self { truth, keyframes }
    }
}
