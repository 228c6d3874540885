//! The exhaustive search on known motions, and the inputs that it rejects.

use crate::common::{Numbers, draw, errors, pair, pair_of, pose_deg, scene_aside};
use gyre_matching::{ExhaustiveConfig, ExhaustiveSearch, JointMatch, Overlap, Peak};
use ndarray::Array2;

fn search(
    n: usize,
    cell_m: f64,
    config: &ExhaustiveConfig,
    earlier: &Array2<f32>,
    later: &Array2<f32>,
) -> JointMatch {
    ExhaustiveSearch::new(n, cell_m, config)
        .unwrap()
        .search(later.view(), earlier.view())
        .unwrap()
}

/// A rotation by zero does not blur; without compensation the peak would be pushed off zero.
#[test]
fn small_angles_are_not_pushed_off_zero() {
    let config = ExhaustiveConfig {
        reach_deg: 3.0,
        step_deg: 0.25,
        ..Default::default()
    };
    let mut slopes = Vec::new();
    for seed in 0..6 {
        // A new scene of speckles a cell wide, which blurring changes most.
        let found = |yaw_deg: f64| {
            let motion = pose_deg(1.2, 0.4, yaw_deg);
            let scene = crate::common::scatterers(1500, 60.0, 70 + seed);
            let (earlier, later) = pair_of(&scene, 127, 0.8, 0.6, motion);
            search(127, 0.8, &config, &earlier, &later).motion
        };
        let (left, right) = (found(0.1), found(-0.1));
        slopes.push((left.yaw_rad - right.yaw_rad).to_degrees() / 0.2);
        let off_m = (left.x_m - 1.2).abs().max((left.y_m - 0.4).abs());
        assert!(off_m < 0.1, "{left:?}");
    }
    let mean = slopes.iter().sum::<f64>() / slopes.len() as f64;
    assert!((mean - 1.0).abs() < 0.15, "{slopes:?}");
}

#[test]
fn motions_within_reach_are_found_to_a_fraction_of_a_cell() {
    let (n, cell_m, mut numbers) = (127, 0.8, Numbers(11));
    let plain = ExhaustiveConfig {
        overlap: Overlap::None,
        peak: Peak::Parabola,
        ..ExhaustiveConfig::default()
    };
    for config in [ExhaustiveConfig::default(), plain] {
        let mut squares = [0.0; 3];
        for k in 0..16 {
            let [x_m, y_m, yaw_deg] = [9.0, 9.0, 14.0].map(|limit| numbers.within(limit));
            let motion = pose_deg(x_m, y_m, yaw_deg);
            let (earlier, later) = pair(n, cell_m, motion, 300 + k);
            let found = search(n, cell_m, &config, &earlier, &later);
            for (square, error) in squares.iter_mut().zip(errors(&found.motion, &motion)) {
                *square += error * error / 16.0;
            }
        }
        let rms = squares.map(f64::sqrt);
        let is_within = rms[0].max(rms[1]) < 0.15 * cell_m && rms[2] < 0.2;
        assert!(is_within, "{:?}: {rms:?} (m, m, deg)", config.overlap);
    }
}

#[test]
fn an_angle_at_the_end_of_the_grid_is_uncertain() {
    let (earlier, later) = pair(127, 0.8, pose_deg(0.0, 0.0, 4.0), 9);
    let config = ExhaustiveConfig {
        reach_deg: 3.0,
        ..Default::default()
    };
    let found = search(127, 0.8, &config, &earlier, &later);
    let off_deg = found.motion.yaw_rad.to_degrees() - 3.0;
    let sigma_deg = found.rotation.variance_rad2.sqrt().to_degrees();
    assert!(off_deg.abs() < 1e-9 && sigma_deg > 1.0, "{found:?}");
}

#[test]
fn the_covariance_couples_shift_and_angle_by_the_lever() {
    // All structure 15 m ahead and 4 m to the left: x and y follow the angle by -J centre.
    let raster = draw(scene_aside().into_iter(), 101, 0.5, 1.2);
    let covariance = search(101, 0.5, &ExhaustiveConfig::default(), &raster, &raster)
        .motion
        .covariance;
    let slope = [covariance[(0, 2)], covariance[(1, 2)]].map(|c| c / covariance[(2, 2)]);
    let follows = (slope[0] - 4.0).abs() < 2.0 && (slope[1] + 15.0).abs() < 2.0;
    let is_positive = covariance.symmetric_eigenvalues().min() > 0.0;
    assert!(follows && is_positive, "{covariance}");
}

#[test]
fn two_matches_are_both_reported() {
    let scatterers = [([10.0, -3.0], 1.0), ([10.0, 3.0], 0.7)];
    let earlier = draw(scatterers.into_iter(), 101, 0.5, 1.0);
    let found = search(101, 0.5, &ExhaustiveConfig::default(), &earlier, &earlier);
    let second = found.motion.runner_up.unwrap();
    let best = found.motion.score;
    assert!(second.score < best && best > 0.95, "{found:?}");
}

#[test]
fn rasters_without_a_match_give_no_motion_and_a_wide_covariance() {
    let (earlier, later) = pair(65, 0.8, pose_deg(1.0, 0.0, 2.0), 1);
    let empty = Array2::zeros((65, 65));
    for (f, g) in [(&empty, &empty), (&later, &empty), (&empty, &earlier)] {
        let found = search(65, 0.8, &ExhaustiveConfig::default(), g, f);
        let motion = found.motion;
        assert_eq!([motion.x_m, motion.yaw_rad, motion.score], [0.0; 3]);
        let sigma_deg = found.rotation.variance_rad2.sqrt().to_degrees();
        assert!(sigma_deg > 5.0 && motion.covariance[(0, 0)] > 10.0);
    }
}

#[test]
fn rasters_of_another_shape_and_impossible_reaches_are_rejected() {
    let config = ExhaustiveConfig {
        reach_m: 30.0,
        ..ExhaustiveConfig::default()
    };
    let error = ExhaustiveSearch::new(65, 0.8, &config).err().unwrap();
    let words = "exhaustive.reach_m is 30, but must be";
    assert!(error.to_string().starts_with(words), "{error}");
    let mut exhaustive = ExhaustiveSearch::new(97, 0.8, &config).unwrap();
    let (raster, small) = (Array2::zeros((97, 97)), Array2::zeros((7, 97)));
    assert!(exhaustive.search(raster.view(), small.view()).is_err());
    assert!(exhaustive.search(small.view(), raster.view()).is_err());
}

#[test]
fn results_do_not_depend_on_earlier_searches() {
    let (earlier, later) = pair(97, 0.8, pose_deg(2.0, -1.0, 5.0), 2);
    let fresh = search(97, 0.8, &ExhaustiveConfig::default(), &earlier, &later);
    let mut used = ExhaustiveSearch::new(97, 0.8, &ExhaustiveConfig::default()).unwrap();
    let bright = Array2::from_elem((97, 97), 5.0);
    for (f, g) in [(&bright, &later), (&later, &bright), (&earlier, &later)] {
        used.search(f.view(), g.view()).unwrap();
    }
    assert_eq!(used.search(later.view(), earlier.view()).unwrap(), fresh);
}
