//! Measured positions in a frame of their own: the least-squares solution, its covariance, wrong
//! positions.

use gyre_geometry::{Pose, UncertainMotion, pose};
use gyre_slam::estimation::{GraphOptions, Kernel, PoseGraph, Position};
use nalgebra::{Point2, Vector2, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::common::{Drive, ODOMETRY, moved};

const KEYFRAMES: usize = 120;
const SIGMA_M: f64 = 1.5;
const LEVER_M: [f64; 2] = [-1.2, 0.4];

fn true_frame() -> Pose {
    pose(340.0, -120.0, 2.1)
}

fn measure(drive: &Drive, every: usize, seed: u64) -> Vec<Position> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut noise = || -> f64 { StandardNormal.sample(&mut random) };
    let positions = (0..drive.truth.len()).step_by(every).map(|keyframe| {
        let at = true_frame() * drive.truth[keyframe] * Point2::from(LEVER_M);
        Position {
            keyframe,
            lever_m: Vector2::from(LEVER_M),
            position_m: at.coords + SIGMA_M * Vector2::new(noise(), noise()),
            variance_m2: SIGMA_M * SIGMA_M,
            share: 1.0,
        }
    });
    positions.collect()
}

fn graph(drive: &Drive, positions: &[Position], kernel: Kernel) -> PoseGraph {
    let options = GraphOptions {
        kernel,
        tolerance: 1e-12,
        ..GraphOptions::default()
    };
    let mut graph = PoseGraph::new(drive.truth[0], options);
    for motion in &drive.odometry {
        graph.apply(motion).unwrap();
    }
    for position in positions {
        graph.measure(*position).unwrap();
    }
    graph
}

fn robust() -> Kernel {
    GraphOptions::default().kernel
}

/// Half the sum of the squared normalised residuals, written independently.
fn cost(drive: &Drive, positions: &[Position], poses: &[Pose], frame: &Pose) -> f64 {
    let motions = drive.odometry.iter().map(|it| {
        let found = poses[it.from].inverse() * poses[it.to];
        let error = it.motion.error(&found);
        error.dot(&(it.motion.covariance.try_inverse().unwrap() * error))
    });
    let positions = positions.iter().map(|it| {
        let at = frame * poses[it.keyframe] * Point2::from(it.lever_m);
        it.share * (at.coords - it.position_m).norm_squared() / it.variance_m2
    });
    0.5 * motions.chain(positions).sum::<f64>()
}

#[test]
fn the_solution_is_where_no_pose_lowers_the_sum_of_squares() {
    let drive = Drive::new(KEYFRAMES, 60, ODOMETRY, 5);
    let mut positions = measure(&drive, 3, 6);
    positions[4].share = 0.1;
    let mut graph = graph(&drive, &positions, Kernel::None);
    assert!(graph.solve().unwrap().converged);
    let (poses, frame) = (graph.poses().to_vec(), graph.frame().unwrap());
    let at_solution = cost(&drive, &positions, &poses, &frame);
    assert!((at_solution - graph.cost()).abs() < 1e-6 * at_solution);
    for axis in 0..3 {
        let step = 1e-4;
        let slope = |of: &dyn Fn(f64) -> f64| (of(step) - of(-step)) / (2.0 * step);
        let by = |step: f64| Vector3::ith(axis, step);
        let by_frame = |step| cost(&drive, &positions, &poses, &moved(&frame, &by(step)));
        // In units of a standard deviation: sqrt of the curvature.
        let curvature = (by_frame(step) + by_frame(-step) - 2.0 * at_solution) / (step * step);
        assert!(
            slope(&by_frame).abs() < 1e-2 * curvature.sqrt(),
            "frame {axis}"
        );
        for keyframe in [1, 40, KEYFRAMES - 1] {
            let by_pose = |step| {
                let mut poses = poses.clone();
                poses[keyframe] = moved(&poses[keyframe], &by(step));
                cost(&drive, &positions, &poses, &frame)
            };
            let curvature = (by_pose(step) + by_pose(-step) - 2.0 * at_solution) / (step * step);
            assert!(
                slope(&by_pose).abs() < 1e-2 * curvature.sqrt(),
                "{keyframe} {axis}"
            );
        }
    }
}

#[test]
fn the_covariance_of_the_frame_is_that_of_its_errors() {
    let mut sum = 0.0;
    const DRIVES: u64 = 100;
    for seed in 0..DRIVES {
        let drive = Drive::new(60, 60, ODOMETRY, seed);
        let mut graph = graph(&drive, &measure(&drive, 2, 1000 + seed), robust());
        graph.solve_anew().unwrap();
        let found: UncertainMotion = graph.uncertain_frame().unwrap().unwrap();
        let error = found.error(&true_frame());
        sum += error.dot(&(found.covariance.try_inverse().unwrap() * error)) / 3.0;
    }
    let nees = sum / DRIVES as f64;
    // Of 100 drives the mean has a standard deviation of 0.08.
    assert!((0.7..1.35).contains(&nees), "{nees}");
}

/// Moves the positions of some keyframes as a reflection does.
fn reflected(
    mut positions: Vec<Position>,
    stretch: std::ops::Range<usize>,
    by: f64,
) -> Vec<Position> {
    for it in &mut positions {
        if stretch.contains(&it.keyframe) {
            it.position_m += Vector2::new(0.6 * by, -0.8 * by);
        }
    }
    positions
}

#[test]
fn a_stretch_of_wrong_positions_is_refused_and_moves_nothing() {
    let drive = Drive::new(400, 160, ODOMETRY, 2);
    let right = measure(&drive, 2, 3);
    for by in [10.0, 30.0, 1000.0] {
        let stretch = 150..270;
        let mut with_wrong = graph(
            &drive,
            &reflected(right.clone(), stretch.clone(), by),
            robust(),
        );
        with_wrong.solve_anew().unwrap();
        let weights: Vec<_> = with_wrong
            .positions()
            .map(|it| (it.position.keyframe, it.weight))
            .collect();
        let wrong = |keyframe: &usize| stretch.contains(keyframe);
        let taken = weights
            .iter()
            .filter(|(keyframe, weight)| wrong(keyframe) && *weight > 0.25);
        let lost = weights
            .iter()
            .filter(|(keyframe, weight)| !wrong(keyframe) && *weight < 0.25);
        let (taken, lost) = (taken.count(), lost.count());
        assert!(
            taken <= 3 && lost <= 3,
            "{by} m: {taken} wrong taken, {lost} right lost"
        );
        let others: Vec<Position> = right
            .iter()
            .filter(|it| !wrong(&it.keyframe))
            .copied()
            .collect();
        let mut without = graph(&drive, &others, robust());
        without.solve_anew().unwrap();
        let [a, b] =
            [&with_wrong, &without].map(|graph| graph.frame().unwrap() * graph.poses()[210]);
        let apart = (a.translation.vector - b.translation.vector).norm();
        // Odometry is known to 0.4 m over half of the stretch.
        assert!(apart < 0.6, "{by} m: {apart}");
    }
}

#[test]
fn positions_that_do_not_tell_the_heading_move_no_pose() {
    let drive = Drive::new(KEYFRAMES, 60, ODOMETRY, 5);
    let mut graph = graph(&drive, &measure(&drive, 1, 6)[..3], robust());
    let before = graph.poses().to_vec();
    graph.solve().unwrap();
    assert_eq!(graph.poses(), before);
    assert!(graph.frame().is_none() && graph.uncertain_frame().unwrap().is_none());
    assert!(graph.positions().all(|it| it.weight == 0.0));
}

#[test]
fn the_order_of_positions_and_what_was_solved_before_do_not_matter_to_a_solution_anew() {
    let drive = Drive::new(KEYFRAMES, 60, ODOMETRY, 5);
    let positions = measure(&drive, 3, 6);
    let mut at_once = graph(&drive, &positions, robust());
    at_once.solve_anew().unwrap();
    let mut piecewise = graph(&drive, &positions[..10], robust());
    piecewise.solve().unwrap();
    for position in &positions[10..] {
        piecewise.measure(*position).unwrap();
        piecewise.solve().unwrap();
    }
    piecewise.solve_anew().unwrap();
    assert_eq!(at_once.poses(), piecewise.poses());
    assert_eq!(at_once.frame(), piecewise.frame());
}

#[test]
fn a_position_that_cannot_be_weighted_is_refused() {
    let drive = Drive::new(4, 60, ODOMETRY, 5);
    let position = measure(&drive, 1, 6)[2];
    let mut graph = graph(&drive, &[], robust());
    let changes: [fn(&mut Position); 5] = [
        |it| it.keyframe = 4,
        |it| it.variance_m2 = 0.0,
        |it| it.share = 0.0,
        |it| it.share = 2.0,
        |it| it.position_m.x = f64::NAN,
    ];
    for change in changes {
        let mut wrong = position;
        change(&mut wrong);
        assert!(graph.measure(wrong).is_err());
    }
}
