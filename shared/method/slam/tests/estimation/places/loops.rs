//! Verification of loops between drawn places.

use std::f64::consts::PI;

use gyre_geometry::{Pose, pose, wrap_angle};
use gyre_matching::{RefinementConfig, Submap};
use gyre_slam::{
    LoopCandidate, LoopOutcome,
    estimation::places::{Candidate, Registrar},
};
use proptest::prelude::*;

use super::scenes;

fn verify(later: &Submap, earlier: &Submap, yaw_rad: f64) -> LoopCandidate {
    let candidate = Candidate {
        place: 0,
        score: 1.0,
        yaw_rad,
    };
    let mut registrar = Registrar::new(&RefinementConfig::default(), 8192).unwrap();
    registrar.verify(later, earlier, &candidate)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]
    #[test]
    fn a_loop_is_measured_at_any_heading(
        seed in 0_u64..1000, x in -15.0_f64..15.0, y in -15.0_f64..15.0, yaw in -3.1_f64..3.1, off in -0.01_f64..0.01,
    ) {
        let (place, truth) = (scenes::place(seed), pose(x, y, yaw));
        let (later, earlier) = (scenes::seen(&place, &truth), scenes::seen(&place, &Pose::identity()));
        // The descriptors know the angle up to half a turn.
        let half = 0.5 * wrap_angle(2.0 * (yaw + off));
        let found = verify(&later, &earlier, half);
        prop_assert_eq!(found.outcome, LoopOutcome::Accepted);
        let error = found.motion.error(&truth);
        prop_assert!(error.xy().norm() < 0.03 && error.z.abs() < 1e-3, "{error}");
        prop_assert!(found.motion.has_covariance());
    }
}

#[test]
fn other_places_are_rejected() {
    let seen = |seed| scenes::seen(&scenes::place(seed), &Pose::identity());
    for seed in 0..5 {
        let found = verify(&seen(seed), &seen(seed + 1), 0.3);
        assert_eq!(found.outcome, LoopOutcome::LowCorrelation, "{found:?}");
    }
}

#[test]
fn a_place_that_repeats_itself_is_ambiguous() {
    // Posts in a grid of 10 m look the same 10 m farther on, and after any quarter turn.
    let grid: Vec<[f64; 2]> = (0..289)
        .map(|k| [f64::from(k % 17 - 8), f64::from(k / 17 - 8)].map(|at| 10.0 * at))
        .collect();
    let earlier = scenes::seen(&grid, &Pose::identity());
    for yaw in [0.0, PI] {
        let found = verify(&scenes::seen(&grid, &pose(1.0, 2.0, yaw)), &earlier, 0.0);
        assert_eq!(found.outcome, LoopOutcome::Ambiguous, "{found:?}");
    }
}

#[test]
fn empty_submaps_and_points_that_are_not_finite_are_no_loop() {
    let place = scenes::seen(&scenes::place(1), &Pose::identity());
    let nan = scenes::seen(&[[f64::NAN, 1.0], [1.0, f64::INFINITY]], &Pose::identity());
    for bad in [&Submap::default(), &nan] {
        for (later, earlier) in [(bad, &place), (&place, bad), (bad, bad)] {
            let found = verify(later, earlier, 0.0);
            assert_eq!(found.outcome, LoopOutcome::LowCorrelation);
            assert_eq!(found.correlation, 0.0);
        }
    }
}
