//! A drive several times around a block with scattered reflectors, seen from each keyframe.
#![allow(dead_code, reason = "each test uses a part")]

use std::f64::consts::TAU;

use gyre_geometry::{Pose, SparsePoint, Twist, UncertainMotion, pose};
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
        let covariance = Matrix3::from_diagonal(&Vector3::from(SIGMA.map(|sigma| sigma * sigma)));
        let mut drive = Self {
            truth,
            keyframes: Vec::new(),
        };
        let mut reckoned = UncertainMotion::identity();
        for k in 0..keyframes {
            let motion = match k {
                0 => UncertainMotion::identity(),
                _ => {
                    let [x, y, yaw] =
                        SIGMA.map(|sigma| Normal::new(0.0, sigma).unwrap().sample(&mut random));
                    let exact = drive.truth[k - 1].inv_mul(&drive.truth[k]);
                    let motion = pose(x, y, 0.0) * exact * pose(0.0, 0.0, yaw);
                    UncertainMotion { motion, covariance }
                }
            };
            reckoned = reckoned.then(&motion).normalized();
            let points = drive.points(k, &reflectors, &mut random);
            drive.keyframes.push(Keyframe {
                seq: 4 * k as u64,
                scan: 4 * k as u64,
                stamp_ns: k as i64 * 1_000_000_000,
                pose: reckoned,
                motion: motion.normalized(),
                noise: Matrix3::zeros(),
                twist: Twist::default(),
                path_m: STEP_M * k as f64,
                points,
            });
        }
        drive
    }

    fn points(
        &self,
        k: usize,
        reflectors: &[Point2<f64>],
        random: &mut ChaCha8Rng,
    ) -> Vec<SparsePoint> {
        let seen = reflectors.iter().map(|at| self.truth[k].inverse() * at);
        seen.filter(|at| at.coords.norm() < 75.0)
            .map(|at| {
                let mut noise = || random.random_range(-0.05..0.05);
                let (x, y) = (at.x + noise(), at.y + noise());
                SparsePoint::from([x as f32, y as f32, 0.0, 0.8, 0.0])
            })
            .collect()
    }
}
