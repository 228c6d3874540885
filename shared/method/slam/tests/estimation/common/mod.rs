//! Simulated drives with Gaussian errors, and their least-squares solution by dense matrices.
#![allow(dead_code, clippy::unwrap_used)]

use std::f64::consts::TAU;

use gyre_geometry::{Pose, UncertainMotion, pose, xy_yaw};
use gyre_slam::estimation::{Constraint, TrajectoryFilter};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Standard deviations of x and y, m, and of yaw, rad.
pub type Sigma = [f64; 3];

pub const ODOMETRY: Sigma = [0.04, 0.03, 0.0005];
pub const LOOP: Sigma = [0.1, 0.1, 0.003];

/// Returns a covariance with correlated x and y.
pub fn covariance([x, y, yaw]: Sigma) -> Matrix3<f64> {
    let xy = 0.3 * x * y;
    Matrix3::new(x * x, xy, 0.0, xy, y * y, 0.0, 0.0, 0.0, yaw * yaw)
}

pub fn exact(motion: Pose, sigma: Sigma) -> UncertainMotion {
    UncertainMotion {
        motion,
        covariance: covariance(sigma),
    }
}

pub struct Drive {
    pub truth: Vec<Pose>,
    pub odometry: Vec<Constraint>,
    random: ChaCha8Rng,
}

impl Drive {
    /// Simulates `keyframes` keyframes 2 m apart, along a curve that closes after `around` of them.
    pub fn new(keyframes: usize, around: usize, sigma: Sigma, seed: u64) -> Self {
        let mut truth = vec![Pose::identity()];
        for k in 1..keyframes {
            let along = TAU * k as f64 / around as f64;
            let turn = TAU / around as f64 * (1.0 + 0.8 * (3.0 * along).cos());
            truth.push(truth[k - 1] * pose(2.0, 0.0, turn));
        }
        let mut drive = Self {
            truth,
            odometry: Vec::new(),
            random: ChaCha8Rng::seed_from_u64(seed),
        };
        drive.odometry = (1..keyframes)
            .map(|k| Constraint::odometry(k - 1, drive.measure(k - 1, k, sigma)))
            .collect();
        drive
    }

    pub fn measure(&mut self, from: usize, to: usize, sigma: Sigma) -> UncertainMotion {
        let covariance = covariance(sigma);
        let normal: [f64; 3] = std::array::from_fn(|_| StandardNormal.sample(&mut self.random));
        let error = covariance.cholesky().unwrap().l() * Vector3::from(normal);
        let [x, y, yaw] = xy_yaw(&(self.truth[from].inverse() * self.truth[to]));
        UncertainMotion {
            motion: pose(x + error.x, y + error.y, yaw + error.z),
            covariance,
        }
    }

    pub fn close(&mut self, from: usize, to: usize) -> Constraint {
        Constraint::closing(from, to, self.measure(from, to, LOOP))
    }

    pub fn filter(&self) -> TrajectoryFilter {
        let mut filter = TrajectoryFilter::new(self.truth[0], TrajectoryFilter::MAX_KEYFRAMES);
        for motion in &self.odometry {
            filter.apply(motion).unwrap();
        }
        filter
    }
}

pub fn dead_reckoning(start: Pose, odometry: &[Constraint]) -> Vec<Pose> {
    let mut poses = vec![start];
    for constraint in odometry {
        poses.push(poses[poses.len() - 1] * constraint.motion.motion);
    }
    poses
}

/// A linearised least-squares problem over all poses but the first, by dense matrices and
/// differences.
pub struct Batch {
    pub poses: Vec<Pose>,
    pub covariance: DMatrix<f64>,
}

impl Batch {
    pub fn solve(poses: &[Pose], constraints: &[Constraint], steps: usize) -> Self {
        let mut poses = poses.to_vec();
        let mut covariance = DMatrix::zeros(0, 0);
        for _ in 0..steps {
            let (information, gradient) = normal_equations(&poses, constraints);
            covariance = information.try_inverse().unwrap();
            let step = &covariance * gradient;
            for (k, pose) in poses.iter_mut().enumerate().skip(1) {
                *pose = moved(pose, &step.fixed_rows::<3>(3 * (k - 1)).into_owned());
            }
        }
        Self { poses, covariance }
    }
}

pub fn moved(from: &Pose, by: &Vector3<f64>) -> Pose {
    let [x, y, yaw] = xy_yaw(from);
    pose(x + by.x, y + by.y, yaw + by.z)
}

fn residual(poses: [&Pose; 2], constraint: &Constraint) -> Vector3<f64> {
    constraint.motion.error(&(poses[0].inverse() * poses[1]))
}

fn normal_equations(poses: &[Pose], constraints: &[Constraint]) -> (DMatrix<f64>, DVector<f64>) {
    let size = 3 * (poses.len() - 1);
    let (mut information, mut gradient) = (DMatrix::zeros(size, size), DVector::zeros(size));
    for constraint in constraints {
        let ends = [constraint.from, constraint.to];
        let here = residual(ends.map(|end| &poses[end]), constraint);
        let mut jacobian = DMatrix::zeros(3, size);
        for (side, axis) in (0..6)
            .map(|i| (i / 3, i % 3))
            .filter(|&(side, _)| ends[side] > 0)
        {
            let mut step = Vector3::zeros();
            step[axis] = 1e-6;
            let mut at = ends.map(|end| poses[end]);
            let ahead = moved(&at[side], &step);
            let behind = moved(&at[side], &-step);
            at[side] = ahead;
            let ahead = residual([&at[0], &at[1]], constraint);
            at[side] = behind;
            let behind = residual([&at[0], &at[1]], constraint);
            // The residual is the measurement minus the prediction, whose Jacobian is sought.
            jacobian
                .column_mut(3 * (ends[side] - 1) + axis)
                .copy_from(&((behind - ahead) / 2e-6));
        }
        let weight = constraint.motion.covariance.try_inverse().unwrap();
        information += jacobian.transpose() * weight * &jacobian;
        gradient += jacobian.transpose() * (weight * here);
    }
    (information, gradient)
}

/// Returns the largest distance between two trajectories, m, and the largest difference of yaw,
/// rad.
pub fn apart(a: &[Pose], b: &[Pose]) -> (f64, f64) {
    assert_eq!(a.len(), b.len());
    let pairs = || a.iter().zip(b);
    let position = pairs().map(|(a, b)| (a.translation.vector - b.translation.vector).norm());
    let yaw = pairs().map(|(a, b)| a.rotation.angle_to(&b.rotation).abs());
    (position.fold(0.0, f64::max), yaw.fold(0.0, f64::max))
}

/// Returns the root mean square distance between two trajectories, m.
pub fn rms_apart(a: &[Pose], b: &[Pose]) -> f64 {
    let squared = a
        .iter()
        .zip(b)
        .map(|(a, b)| (a.translation.vector - b.translation.vector).norm_squared());
    (squared.sum::<f64>() / a.len() as f64).sqrt()
}
