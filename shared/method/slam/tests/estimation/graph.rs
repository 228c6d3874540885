//! The pose graph against a dense batch solution, against the trajectory filter, and on odd input.

use super::common::{Batch, Drive, ODOMETRY, apart, dead_reckoning, exact};
use gyre_geometry::{Pose, pose, xy_yaw};
use gyre_slam::estimation::{
    Constraint, GraphOptions, Kernel, Kind, Outcome, PoseGraph, TrajectoryFilter,
};

fn graph(drive: &Drive, loops: &[Constraint], options: GraphOptions) -> PoseGraph {
    let mut graph = PoseGraph::new(drive.truth[0], options);
    for constraint in drive.odometry.iter().chain(loops) {
        let verdict = graph.apply(constraint).unwrap();
        assert_eq!(verdict.outcome, Outcome::Accepted, "{verdict:?}");
    }
    graph
}

fn least_squares() -> GraphOptions {
    GraphOptions {
        kernel: Kernel::None,
        tolerance: 1e-12,
        ..GraphOptions::default()
    }
}

fn three_rounds(seed: u64) -> (Drive, Vec<Constraint>) {
    let mut drive = Drive::new(90, 30, ODOMETRY, seed);
    let pairs = [(35, 5), (20, 50), (61, 0), (70, 10), (59, 88)];
    let loops = pairs.map(|(from, to)| drive.close(from, to)).to_vec();
    (drive, loops)
}

#[test]
fn the_solution_and_its_covariances_are_those_of_the_dense_batch() {
    let (drive, loops) = three_rounds(3);
    let mut graph = graph(&drive, &loops, least_squares());
    let solution = graph.solve().unwrap();
    assert!(
        solution.converged && solution.iterations < 10,
        "{solution:?}"
    );

    let started = dead_reckoning(drive.truth[0], &drive.odometry);
    let all: Vec<_> = drive.odometry.iter().copied().chain(loops).collect();
    let batch = Batch::solve(&started, &all, 8);
    let (position, yaw) = apart(graph.poses(), &batch.poses);
    assert!(position < 1e-6 && yaw < 1e-8, "{position} m, {yaw} rad");
    for k in 1..90 {
        let at = 3 * (k - 1);
        let expected = batch.covariance.fixed_view::<3, 3>(at, at);
        let found = graph.pose(k).unwrap().covariance;
        assert!((found - expected).norm() < 1e-5 * expected.norm(), "{k}");
    }
}

#[test]
fn filter_and_graph_agree_on_small_problems() {
    for seed in 10..14 {
        let (drive, loops) = three_rounds(seed);
        let mut filter = drive.filter();
        let mut graph = graph(&drive, &[], least_squares());
        for k in [0, 1, 45, 89] {
            let (of_filter, of_graph) = (filter.pose(k).unwrap(), graph.pose(k).unwrap());
            assert_eq!(of_filter.motion, of_graph.motion);
            let difference = of_filter.covariance - of_graph.covariance;
            assert!(difference.norm() < 1e-9, "{difference}");
        }
        // One loop, then all.
        for loops in [&loops[..1], &loops[1..]] {
            for closing in loops {
                assert_eq!(filter.apply(closing).unwrap().outcome, Outcome::Accepted);
                graph.apply(closing).unwrap();
            }
            graph.solve().unwrap();
            let (position, yaw) = apart(filter.poses(), graph.poses());
            assert!(
                position < 1e-3 && yaw.to_degrees() < 1e-3,
                "{seed}: {position} m, {} deg",
                yaw.to_degrees()
            );
            let (of_filter, of_graph) = (filter.pose(88).unwrap(), graph.pose(88).unwrap());
            let difference = of_filter.covariance - of_graph.covariance;
            assert!(difference.norm() < 0.01 * of_graph.covariance.norm());
        }
    }
}

#[test]
fn a_graph_of_one_keyframe_is_solved() {
    let mut graph = PoseGraph::new(pose(1.0, 2.0, 0.3), GraphOptions::default());
    assert_eq!(graph.solve().unwrap().cost, 0.0);
    let only = graph.pose(0).unwrap();
    assert_eq!(
        (only.motion, only.covariance.norm()),
        (pose(1.0, 2.0, 0.3), 0.0)
    );
    assert!(graph.predict(0, 1).is_err());
}

#[test]
fn keyframes_after_a_solution_continue_from_the_corrected_trajectory() {
    let (drive, loops) = three_rounds(6);
    let mut graph = PoseGraph::new(drive.truth[0], GraphOptions::default());
    for constraint in &drive.odometry[..75] {
        graph.apply(constraint).unwrap();
    }
    for closing in &loops[..3] {
        graph.apply(closing).unwrap();
    }
    graph.solve().unwrap();
    let last = graph.pose(75).unwrap();
    let next = &drive.odometry[75];
    graph.apply(next).unwrap();
    let expected = last.then(&next.motion);
    let found = graph.pose(76).unwrap();
    assert_eq!(found.motion, expected.motion);
    let difference = found.covariance - expected.covariance;
    assert!(
        difference.norm() < 1e-3 * expected.covariance.norm(),
        "{difference}"
    );
}

#[test]
fn the_solution_from_the_odometry_does_not_depend_on_the_order_of_loops() {
    let (drive, mut loops) = three_rounds(7);
    let mut ahead = graph(&drive, &loops, GraphOptions::default());
    loops.reverse();
    let mut behind = PoseGraph::new(drive.truth[0], GraphOptions::default());
    for constraint in &drive.odometry {
        behind.apply(constraint).unwrap();
    }
    for closing in &loops {
        behind.apply(closing).unwrap();
        behind.solve().unwrap();
    }
    let (a, b) = (ahead.solve_anew().unwrap(), behind.solve_anew().unwrap());
    assert_eq!(a, b);
    let bits = |graph: &PoseGraph| -> Vec<_> {
        let values = graph.poses().iter().flat_map(xy_yaw);
        values.map(f64::to_bits).collect()
    };
    assert_eq!(bits(&ahead), bits(&behind), "the same bytes");
}

#[test]
fn a_solution_that_ran_out_of_iterations_says_so_and_can_be_continued() {
    let (drive, loops) = three_rounds(4);
    let options = GraphOptions {
        max_iterations: 1,
        ..least_squares()
    };
    let mut graph = graph(&drive, &loops, options);
    assert!(!graph.solve().unwrap().converged);
    assert!((0..20).any(|_| graph.solve().unwrap().converged));
}

#[test]
fn a_loop_is_tested_against_the_odometry_in_either_direction() {
    let (drive, loops) = three_rounds(8);
    let closing = loops[0];
    let motion = closing.motion;
    let mut graph = graph(&drive, &[], GraphOptions::default());
    let predicted = graph.predict(closing.from, closing.to).unwrap();
    let innovation = motion.error(&predicted.motion);
    let sum = predicted.covariance + motion.covariance;
    let expected = innovation.dot(&(sum.try_inverse().unwrap() * innovation));
    let verdict = graph.apply(&closing).unwrap();
    assert!((verdict.chi_square - expected).abs() < 1e-6 * expected);

    let far = motion.motion * pose(5.0, 0.0, 0.0);
    let wrong = Constraint::closing(closing.from, closing.to, exact(far, [0.1, 0.1, 0.003]));
    assert_eq!(graph.apply(&wrong).unwrap().outcome, Outcome::Rejected);
    assert_eq!(graph.loops().count(), 1);
}

#[test]
fn a_group_of_equal_loops_counts_as_one() {
    let (drive, loops) = three_rounds(9);
    let once = loops[0];
    let member = Constraint {
        kind: Kind::Loop { group: Some(1) },
        ..once
    };
    let mut single = graph(&drive, &[once], least_squares());
    let mut group = graph(&drive, &[member; 7], least_squares());
    single.solve().unwrap();
    group.solve().unwrap();
    assert!(apart(single.poses(), group.poses()).0 < 1e-9);
    let [a, b] = [&mut single, &mut group].map(|graph| graph.pose(80).unwrap().covariance);
    assert!((a - b).norm() < 1e-9 * a.norm());
}

#[test]
fn constraints_that_cannot_be_used_change_nothing() {
    let (drive, loops) = three_rounds(2);
    let mut graph = graph(&drive, &loops, GraphOptions::default());
    let mut filter = TrajectoryFilter::new(Pose::identity(), Default::default());
    let before = graph.poses().to_vec();
    let mut flat = loops[0];
    flat.motion.covariance *= 0.0;
    assert!(graph.apply(&flat).is_err());
    let gap = Constraint::odometry(95, loops[0].motion);
    assert!(graph.apply(&gap).is_err() && filter.apply(&gap).is_err());
    assert!(graph.start_from(&before[1..]).is_err());
    assert_eq!(graph.poses(), before);
}
