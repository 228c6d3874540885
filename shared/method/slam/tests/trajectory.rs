//! The trajectory from odometry and loops, right and wrong ones.

use gyre_geometry::{Pose, UncertainMotion, pose};
use gyre_slam::{
    EstimatorKind, JudgedLoop, LoopVerdict, TrajectoryEstimator, estimation::Constraint,
};
use nalgebra::{Matrix3, Vector3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::{
    common::{AROUND, Drive},
    estimation::common::{apart, rms_apart},
};

const KEYFRAMES: usize = 4 * AROUND;

fn closing(from: usize, to: usize, motion: Pose) -> Constraint {
    let covariance = Matrix3::from_diagonal(&Vector3::new(0.0025, 0.0025, 1e-6));
    Constraint::closing(from, to, UncertainMotion { motion, covariance })
}

/// Loops between every other keyframe and its counterpart of the round before.
fn right(drive: &Drive) -> Vec<Constraint> {
    let loops = (AROUND..KEYFRAMES).step_by(2).map(|to| {
        let from = to - AROUND;
        closing(from, to, drive.truth[from].inv_mul(&drive.truth[to]))
    });
    loops.collect()
}

/// Fifty loops between places that are not the same, in runs of `length` that agree with each
/// other.
fn wrong(drive: &Drive, length: usize) -> Vec<Constraint> {
    let mut random = ChaCha8Rng::seed_from_u64(length as u64);
    let mut loops = Vec::new();
    while loops.len() < 50 {
        let to = random.random_range(AROUND..KEYFRAMES - length);
        let from = random.random_range(0..to - 20);
        let apart = drive.truth[from].inv_mul(&drive.truth[to]);
        if apart.translation.vector.norm() < 10.0 {
            continue;
        }
        let shift = pose(
            random.random_range(-2.0..2.0),
            0.0,
            random.random_range(-0.3..0.3),
        );
        let moved = drive.truth[from] * shift * drive.truth[to].inverse();
        loops.extend((0..length).map(|k| {
            let motion = drive.truth[from + k].inv_mul(&(moved * drive.truth[to + k]));
            closing(from + k, to + k, motion)
        }));
    }
    loops
}

fn odometry(drive: &Drive, kind: EstimatorKind) -> TrajectoryEstimator {
    let mut estimator = TrajectoryEstimator::new(kind);
    drive
        .keyframes
        .iter()
        .for_each(|it| estimator.push(it).unwrap());
    estimator
}

fn update(drive: &Drive, loops: &[Constraint], kind: EstimatorKind) -> TrajectoryEstimator {
    let mut estimator = odometry(drive, kind);
    for it in loops {
        estimator.close_loop(it).unwrap();
        estimator.update().unwrap();
    }
    estimator
}

fn used(estimator: &TrajectoryEstimator) -> Vec<[usize; 2]> {
    let used = |it: &&JudgedLoop| it.verdict == LoopVerdict::Used;
    let used = estimator.loops().iter().filter(used);
    used.map(|it| [it.constraint.to, it.constraint.from])
        .collect()
}

fn estimate(drive: &Drive, loops: &[Constraint], kind: EstimatorKind) -> TrajectoryEstimator {
    let mut estimator = odometry(drive, kind);
    loops
        .iter()
        .for_each(|it| estimator.close_loop(it).unwrap());
    estimator.solve().unwrap();
    estimator
}

/// Odometry so uncertain that wrong loops pass its gate.
fn uncertain() -> Drive {
    let mut drive = Drive::new(KEYFRAMES, 7);
    for keyframe in &mut drive.keyframes {
        keyframe.motion.covariance *= 100.0;
    }
    drive
}

#[test]
fn wrong_loops_are_rejected_and_right_ones_used() {
    let drive = uncertain();
    let right = right(&drive);
    let clean = estimate(&drive, &right, EstimatorKind::Graph);
    let error_m = rms_apart(clean.poses(), &drive.truth);
    let odometry: Vec<Pose> = drive.keyframes.iter().map(|it| it.pose.motion).collect();
    let before_m = rms_apart(&odometry, &drive.truth);
    assert!(error_m < 0.2 * before_m, "{error_m} m, {before_m} m");
    for length in [1, 10] {
        let wrong = wrong(&drive, length);
        let all: Vec<_> = right.iter().chain(&wrong).copied().collect();
        let mut estimator = estimate(&drive, &all, EstimatorKind::Graph);
        let counted = |it: &&JudgedLoop| it.weight > 0.25;
        assert_eq!(
            estimator.loops().iter().filter(counted).count(),
            right.len()
        );
        let outvoted = |it: &&JudgedLoop| it.verdict == LoopVerdict::ContradictsLoops;
        assert!(estimator.loops().iter().filter(outvoted).count() > 0);
        let worse_m = rms_apart(estimator.poses(), &drive.truth) - error_m;
        assert!(worse_m < 0.01, "{worse_m} m");
        assert!(estimator.pose(KEYFRAMES - 1).unwrap().has_covariance());
    }
}

#[test]
fn the_result_does_not_depend_on_the_order_of_the_loops() {
    let drive = uncertain();
    let mut loops: Vec<_> = right(&drive).into_iter().chain(wrong(&drive, 1)).collect();
    for kind in [EstimatorKind::Graph, EstimatorKind::Filter] {
        let poses = estimate(&drive, &loops, kind).poses().to_vec();
        loops.reverse();
        let estimator = estimate(&drive, &loops, kind);
        assert_eq!(estimator.poses(), poses);
    }
}

#[test]
fn loops_taken_one_by_one_lead_where_all_at_once_do() {
    let drive = uncertain();
    let mut loops: Vec<_> = right(&drive).into_iter().chain(wrong(&drive, 1)).collect();
    loops.sort_by_key(|it| it.to);
    let all = estimate(&drive, &loops, EstimatorKind::Graph);
    let mut updated = update(&drive, &loops, EstimatorKind::Graph);
    assert_eq!(used(&updated), used(&all));
    let (apart_m, _) = apart(updated.poses(), all.poses());
    assert!(apart_m < 0.005, "{apart_m} m");
    updated.solve().unwrap();
    assert_eq!(updated.poses(), all.poses());
}

#[test]
fn wrong_loops_that_came_first_are_withdrawn() {
    let drive = uncertain();
    let (wrong, right) = (wrong(&drive, 10), right(&drive));
    // A run of them that agrees with odometry.
    let mut runs = wrong
        .chunks(10)
        .map(|run| (run, update(&drive, run, EstimatorKind::Graph)));
    let (wrong, mut updated) = runs.find(|(_, it)| used(it).len() == 10).unwrap();
    for it in &right {
        updated.close_loop(it).unwrap();
        updated.update().unwrap();
    }
    let all: Vec<_> = right.iter().chain(wrong).copied().collect();
    let all = estimate(&drive, &all, EstimatorKind::Graph);
    assert_eq!(used(&updated), used(&all));
    let (apart_m, _) = apart(updated.poses(), all.poses());
    assert!(apart_m < 0.005, "{apart_m} m");
}

#[test]
fn the_filter_corrects_as_the_graph_does_one_by_one_too() {
    let drive = Drive::new(KEYFRAMES, 8);
    let right = right(&drive);
    let [graph, filter] =
        [EstimatorKind::Graph, EstimatorKind::Filter].map(|kind| estimate(&drive, &right, kind));
    let [by_graph_m, by_filter_m] = [&graph, &filter].map(|it| rms_apart(it.poses(), &drive.truth));
    assert!(
        (by_graph_m - by_filter_m).abs() < 0.02,
        "{by_graph_m} m, {by_filter_m} m"
    );
    let updated = update(&drive, &right, EstimatorKind::Filter);
    let (apart_m, _) = apart(updated.poses(), filter.poses());
    assert!(apart_m < 0.02, "{apart_m} m");
}

#[test]
fn covariances_are_scaled_to_the_residuals() {
    let stated = |factor: f64| {
        let mut drive = Drive::new(KEYFRAMES, 8);
        for keyframe in &mut drive.keyframes {
            keyframe.motion.covariance *= factor;
        }
        drive
    };
    let scale = |factor: f64, loops: &[Constraint]| {
        let mut estimator = estimate(&stated(factor), loops, EstimatorKind::Graph);
        let before = estimator.pose(KEYFRAMES - 1).unwrap().covariance;
        let scale = estimator.scale_covariances().unwrap();
        let after = estimator.pose(KEYFRAMES - 1).unwrap().covariance;
        assert!((after - scale * before).norm() < 1e-9 * after.norm());
        scale
    };
    let right = right(&stated(1.0));
    let scales = [0.25, 1.0, 4.0, 16.0].map(|factor| scale(factor, &right));
    for (scale, expected) in scales.into_iter().zip([4.0, 1.0, 0.25, 0.0625]) {
        // The prior of 1 has the weight of a few residuals.
        let between = [0.6 * f64::min(expected, 1.0), 1.4 * f64::max(expected, 1.0)];
        assert!(
            (between[0]..between[1]).contains(&scale),
            "{scale}, {expected}"
        );
    }
    assert!(scales.is_sorted_by(|a, b| a > b));
    assert!((scale(4.0, &[]) - 1.0).abs() < 1e-6);
}

#[test]
fn corrected_poses_lead_evenly_from_keyframe_to_keyframe() {
    let drive = Drive::new(KEYFRAMES, 9);
    let estimator = estimate(&drive, &right(&drive), EstimatorKind::Graph);
    let correction = estimator.correction();
    let mut last: Option<(Pose, Pose)> = None;
    for seq in 0..4 * KEYFRAMES as u64 {
        let (k, within) = ((seq / 4) as usize, (seq % 4) as f64);
        let odometry = drive.keyframes[k].pose.motion * pose(0.5 * within, 0.0, 0.0);
        let corrected = correction.correct(seq, &odometry);
        if within == 0.0 {
            let apart = corrected.inv_mul(&estimator.poses()[k]);
            assert!(apart.translation.vector.norm() < 1e-9);
        }
        if let Some((from, from_corrected)) = last {
            let step = from.inv_mul(&odometry).translation.vector.norm();
            let corrected_step = from_corrected.inv_mul(&corrected).translation.vector.norm();
            assert!(
                (step - corrected_step).abs() < 0.1,
                "{seq}: {step} {corrected_step}"
            );
        }
        last = Some((odometry, corrected));
    }
    let end = drive.keyframes[KEYFRAMES - 1].pose.motion;
    let past = correction.correct(4 * KEYFRAMES as u64 + 9, &end);
    let apart = past.inv_mul(&estimator.poses()[KEYFRAMES - 1]);
    assert!(apart.translation.vector.norm() < 1e-9);
}
