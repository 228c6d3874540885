//! Wrong loops that are near, single and in consistent tens, change the pose graph little. Those
//! between other places are in `trajectory.rs`.

use std::f64::consts::PI;

use super::common::{Drive, LOOP, ODOMETRY, exact, rms_apart};
use gyre_geometry::{Pose, pose};
use gyre_slam::estimation::{Constraint, GraphOptions, Kind, PoseGraph};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const AROUND: usize = 250;
const KEYFRAMES: usize = 3 * AROUND;
const WRONG: usize = 50;

/// A drive of three rounds with a right loop for each fifth keyframe of the later two.
struct Case {
    drive: Drive,
    right: Vec<Constraint>,
    random: ChaCha8Rng,
}

impl Case {
    fn new(seed: u64) -> Self {
        let mut drive = Drive::new(KEYFRAMES, AROUND, ODOMETRY, seed);
        let right = (AROUND..KEYFRAMES)
            .step_by(5)
            .map(|from| drive.close(from, from - AROUND))
            .collect();
        Self {
            drive,
            right,
            random: ChaCha8Rng::seed_from_u64(seed),
        }
    }

    /// Returns loops between places that are the same, some metres and degrees off, as if one
    /// street were its neighbour. They are within the uncertainty of the odometry.
    fn nearby(&mut self, length: usize) -> Vec<Constraint> {
        let mut loops = Vec::new();
        while loops.len() < WRONG {
            let from = self.random.random_range(AROUND..KEYFRAMES - length);
            let to = from - AROUND;
            let truth = &self.drive.truth;
            let (off, toward) = (
                self.random.random_range(0.9..1.6),
                self.random.random_range(-PI..PI),
            );
            let shift = pose(off * f64::cos(toward), off * f64::sin(toward), 0.01);
            let moved = truth[to] * shift * truth[to].inverse();
            loops.extend(self.run(from, to, moved, length));
        }
        loops
    }

    fn run(&self, from: usize, to: usize, moved: Pose, length: usize) -> Vec<Constraint> {
        let truth = &self.drive.truth;
        let one = |k: usize| {
            let motion = (moved * truth[from + k]).inv_mul(&truth[to + k]);
            let group = Some((from * KEYFRAMES + to) as u64);
            Constraint {
                kind: Kind::Loop { group },
                ..Constraint::closing(from + k, to + k, exact(motion, LOOP))
            }
        };
        (0..length).map(one).collect()
    }

    /// Returns the error of the trajectory, m.
    fn error(&self, wrong: &[Constraint]) -> f64 {
        let mut graph = PoseGraph::new(self.drive.truth[0], GraphOptions::default());
        let all = self.drive.odometry.iter().chain(&self.right);
        for constraint in all.chain(wrong) {
            graph.apply(constraint).unwrap();
        }
        graph.solve_anew().unwrap();
        rms_apart(graph.poses(), &self.drive.truth)
    }
}

#[test]
fn wrong_loops_change_the_trajectory_by_centimetres() {
    let mut worst: f64 = 0.0;
    for seed in 0..4 {
        let mut case = Case::new(seed);
        let clean = case.error(&[]);
        for length in [1, 10] {
            let wrong = case.nearby(length);
            worst = worst.max(case.error(&wrong) - clean);
        }
    }
    assert!(worst < 0.1, "{worst} m");
}
