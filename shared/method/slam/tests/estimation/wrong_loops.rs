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

/// Returns loops between places that are the same, some metres and degrees off, as if one street
/// were its neighbour: runs of `length` that agree with each other. They are within the uncertainty
/// of the odometry.
fn nearby(truth: &[Pose], length: usize, random: &mut ChaCha8Rng) -> Vec<Constraint> {
    let mut loops = Vec::new();
    while loops.len() < WRONG {
        let from = random.random_range(AROUND..KEYFRAMES - length);
        let to = from - AROUND;
        let (off, toward) = (random.random_range(0.9..1.6), random.random_range(-PI..PI));
        let shift = pose(off * f64::cos(toward), off * f64::sin(toward), 0.01);
        let moved = truth[to] * shift * truth[to].inverse();
        let group = Some((from * KEYFRAMES + to) as u64);
        loops.extend((0..length).map(|k| {
            let motion = (moved * truth[from + k]).inv_mul(&truth[to + k]);
            Constraint {
                kind: Kind::Loop { group },
                ..Constraint::closing(from + k, to + k, exact(motion, LOOP))
            }
        }));
    }
    loops
}

/// Returns the error of the trajectory, m.
fn error(drive: &Drive, right: &[Constraint], wrong: &[Constraint]) -> f64 {
    let mut graph = PoseGraph::new(drive.truth[0], GraphOptions::default());
    for constraint in drive.odometry.iter().chain(right).chain(wrong) {
        graph.apply(constraint).unwrap();
    }
    graph.solve_anew().unwrap();
    rms_apart(graph.poses(), &drive.truth)
}

#[test]
fn wrong_loops_change_the_trajectory_by_centimetres() {
    let mut worst: f64 = 0.0;
    for seed in 0..4 {
        // Three rounds, with a right loop for each fifth keyframe of the later two.
        let mut drive = Drive::new(KEYFRAMES, AROUND, ODOMETRY, seed);
        let later = (AROUND..KEYFRAMES).step_by(5);
        let right: Vec<_> = later.map(|from| drive.close(from, from - AROUND)).collect();
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let clean = error(&drive, &right, &[]);
        for length in [1, 10] {
            let wrong = nearby(&drive.truth, length, &mut random);
            worst = worst.max(error(&drive, &right, &wrong) - clean);
        }
    }
    assert!(worst < 0.1, "{worst} m");
}
