//! Covariances agree with errors: the mean NEES of many simulated drives of 500 keyframes lies in
//! its 95 % interval.

use super::common::{Drive, ODOMETRY};
use gyre_geometry::{Pose, UncertainMotion};
use gyre_slam::estimation::{Outcome, PoseGraph};
use statrs::distribution::{ChiSquared, ContinuousCDF};

const KEYFRAMES: usize = 500;
/// The keyframes whose errors count: half-way and at the end.
const JUDGED: [usize; 2] = [KEYFRAMES / 2, KEYFRAMES - 1];
const CASES: [&str; 4] = ["open filter", "filter", "closed filter", "closed graph"];

#[test]
fn estimates_are_consistent_without_loops_before_and_after_closing() {
    assert_consistent(40);
}

#[test]
#[ignore = ".ci/nightly: enough drives to distinguish small faults from chance"]
fn estimates_of_many_drives_are_consistent() {
    assert_consistent(200);
}

fn nees(estimate: &UncertainMotion, truth: &Pose) -> f64 {
    let error = estimate.error(truth);
    error.dot(&estimate.covariance.cholesky().unwrap().solve(&error))
}

fn assert_consistent(drives: u64) {
    let mut sums = [[0.0; 2]; 4];
    for seed in 0..drives {
        let straight = Drive::new(KEYFRAMES, 5 * KEYFRAMES, ODOMETRY, 1000 + seed);
        let mut around = Drive::new(KEYFRAMES, KEYFRAMES, ODOMETRY, seed);
        let (open, before, mut after) = (straight.filter(), around.filter(), around.filter());
        let closing = around.close(KEYFRAMES - 1, 0);
        assert_eq!(after.apply(&closing).unwrap().outcome, Outcome::Accepted);
        let mut graph = PoseGraph::new(around.truth[0], Default::default());
        for constraint in around.odometry.iter().chain([&closing]) {
            graph.apply(constraint).unwrap();
        }
        graph.solve().unwrap();
        for (side, k) in JUDGED.into_iter().enumerate() {
            sums[0][side] += nees(&open.pose(k).unwrap(), &straight.truth[k]);
            sums[1][side] += nees(&before.pose(k).unwrap(), &around.truth[k]);
            sums[2][side] += nees(&after.pose(k).unwrap(), &around.truth[k]);
            sums[3][side] += nees(&graph.pose(k).unwrap(), &around.truth[k]);
        }
    }
    let chi_square = ChiSquared::new((3 * drives) as f64).unwrap();
    let [low, high] = [0.025, 0.975].map(|p| chi_square.inverse_cdf(p));
    for (case, sums) in CASES.iter().zip(sums) {
        let is_consistent = sums.iter().all(|sum| (low..=high).contains(sum));
        assert!(is_consistent, "{case}: {sums:?} outside {low}..{high}");
    }
}
