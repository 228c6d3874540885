//! The trajectory filter on wrong loops, groups and limits. `graph.rs` compares its
//! estimates with the estimates of the graph.

use super::common::{Drive, ODOMETRY, exact};
use gyre_geometry::{Pose, UncertainMotion, pose, xy_yaw};
use gyre_slam::estimation::{Constraint, EstimationError, Kind, Outcome, TrajectoryFilter};
use nalgebra::{Matrix3, Vector3};

/// A motion along x with variance `x` in m^2, and next to no error otherwise.
fn along(x_m: f64, x: f64) -> UncertainMotion {
    UncertainMotion {
        motion: pose(x_m, 0.0, 0.0),
        covariance: Matrix3::from_diagonal(&Vector3::new(x, 1e-9, 1e-12)),
    }
}

fn straight(motions: usize) -> TrajectoryFilter {
    straight_of(TrajectoryFilter::MAX_KEYFRAMES, motions)
}

fn straight_of(limit: usize, motions: usize) -> TrajectoryFilter {
    let mut filter = TrajectoryFilter::new(Pose::identity(), limit);
    for k in 0..motions {
        filter
            .apply(&Constraint::odometry(k, along(1.0, 1.0)))
            .unwrap();
    }
    filter
}

#[test]
fn a_loop_that_contradicts_the_estimate_changes_nothing() {
    let mut filter = straight(2);
    let poses = filter.poses().to_vec();
    // 12 m from the prediction, whose standard deviation is 1.4 m, with one of the measurement of
    // 1.4 m: 36.
    let wrong = Constraint::closing(0, 2, along(14.0, 2.0));
    let verdict = filter.apply(&wrong).unwrap();
    assert_eq!(verdict.outcome, Outcome::Rejected);
    assert!((verdict.chi_square - 36.0).abs() < 1e-3);
    assert_eq!(filter.poses(), poses);
    assert!((filter.pose(2).unwrap().covariance[(0, 0)] - 2.0).abs() < 1e-6);
}

#[test]
fn of_a_group_with_common_errors_only_the_first_loop_counts() {
    let member = |from| Constraint {
        kind: Kind::Loop { group: Some(7) },
        ..Constraint::closing(from, 0, along(-(from as f64) - 0.1, 0.01))
    };
    let mut filter = straight(4);
    assert_eq!(filter.apply(&member(4)).unwrap().outcome, Outcome::Accepted);
    let poses = filter.poses().to_vec();
    assert_eq!(
        filter.apply(&member(3)).unwrap().outcome,
        Outcome::Redundant
    );
    assert_eq!(filter.poses(), poses);
}

#[test]
fn the_covariance_stays_symmetric_and_positive_through_many_loops() {
    let mut drive = Drive::new(200, 25, ODOMETRY, 4);
    let mut filter = drive.filter();
    for from in 30..200 {
        let closing = drive.close(from, from - 25);
        filter.apply(&closing).unwrap();
    }
    for k in 1..200 {
        let covariance = filter.pose(k).unwrap().covariance;
        assert!(covariance.cholesky().is_some(), "{k}: {covariance}");
        assert!((covariance - covariance.transpose()).norm() == 0.0);
    }
}

#[test]
fn a_full_filter_refuses_the_next_keyframe_and_says_what_to_do() {
    let mut filter = straight_of(3, 2);
    let refused = filter.apply(&Constraint::odometry(2, along(1.0, 1.0)));
    assert_eq!(refused, Err(EstimationError::TooManyKeyframes { limit: 3 }));
    assert_eq!(filter.poses().len(), 3);
    assert!(filter.pose(3).is_err());
    // Loops among the keyframes that it has are still taken.
    let closing = Constraint::closing(0, 2, exact(pose(2.1, 0.0, 0.0), [0.1; 3]));
    assert_eq!(filter.apply(&closing).unwrap().outcome, Outcome::Accepted);
    assert!(xy_yaw(&filter.poses()[2])[0] > 2.0);
}
