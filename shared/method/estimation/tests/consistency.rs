//! Covariances agree with errors: the mean NEES of many simulated drives of 500 keyframes lies in
//! its 95 % interval.

use crate::common::{Drive, ODOMETRY};
use gyre_estimation::{Outcome, PoseGraph};
use gyre_geometry::{Pose, UncertainMotion};
use statrs::distribution::{ChiSquared, ContinuousCDF};

const KEYFRAMES: usize = 500;

/// The mean NEES of poses over the drives.
#[derive(Default)]
struct MeanNees {
    sum: f64,
    samples: usize,
}

impl MeanNees {
    fn add(&mut self, estimate: &UncertainMotion, truth: &Pose) {
        let error = estimate.error(truth);
        self.sum += error.dot(&estimate.covariance.cholesky().unwrap().solve(&error));
        self.samples += 1;
    }

    /// Asserts that the mean lies in the 95 % interval of consistent covariances.
    fn check(&self, name: &str, drives: u64) {
        assert_eq!(self.samples, drives as usize);
        let chi_square = ChiSquared::new((3 * self.samples) as f64).unwrap();
        let [low, high] = [0.025, 0.975].map(|p| chi_square.inverse_cdf(p));
        assert!(
            (low..=high).contains(&self.sum),
            "{name}: {} outside {low}..{high}",
            self.sum
        );
    }
}

#[test]
fn estimates_are_consistent_without_loops_before_and_after_closing() {
    let drives = 40;
    let mut open: [MeanNees; 2] = Default::default();
    let mut before: [MeanNees; 2] = Default::default();
    let mut after: [MeanNees; 2] = Default::default();
    let mut of_graph: [MeanNees; 2] = Default::default();
    let of_interest = [KEYFRAMES / 2, KEYFRAMES - 1];
    for seed in 0..drives {
        let straight = Drive::new(KEYFRAMES, 5 * KEYFRAMES, ODOMETRY, 1000 + seed);
        let filter = straight.filter();
        for (nees, k) in open.iter_mut().zip(of_interest) {
            nees.add(&filter.pose(k).unwrap(), &straight.truth[k]);
        }
        let mut around = Drive::new(KEYFRAMES, KEYFRAMES, ODOMETRY, seed);
        let mut filter = around.filter();
        for (nees, k) in before.iter_mut().zip(of_interest) {
            nees.add(&filter.pose(k).unwrap(), &around.truth[k]);
        }
        let closing = around.close(KEYFRAMES - 1, 0);
        assert_eq!(filter.apply(&closing).unwrap().outcome, Outcome::Accepted);
        for (nees, k) in after.iter_mut().zip(of_interest) {
            nees.add(&filter.pose(k).unwrap(), &around.truth[k]);
        }
        let mut graph = PoseGraph::new(around.truth[0], Default::default());
        for constraint in around.odometry.iter().chain([&closing]) {
            graph.apply(constraint).unwrap();
        }
        graph.solve().unwrap();
        for (nees, k) in of_graph.iter_mut().zip(of_interest) {
            nees.add(&graph.pose(k).unwrap(), &around.truth[k]);
        }
    }
    let cases = [
        ("filter without loops", open),
        ("filter before closing", before),
        ("filter after closing", after),
        ("graph after closing", of_graph),
    ];
    for (name, nees) in cases {
        nees[0].check(&format!("{name}, half-way"), drives);
        nees[1].check(&format!("{name}, at the end"), drives);
    }
}
