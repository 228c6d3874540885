//! The exhaustive search against direct sums and known motions, and the inputs that it rejects.

use crate::common::{Motion, Numbers, draw, pair, pair_of, scene_aside};
use gyre_matching::{ExhaustiveConfig, ExhaustiveSearch, JointMatch, Overlap, Peak};
use ndarray::Array2;
use proptest::prelude::*;

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

fn errors(found: &JointMatch, motion: Motion) -> [f64; 3] {
    let turn = (found.motion.yaw_rad - motion.yaw + std::f64::consts::PI)
        .rem_euclid(std::f64::consts::TAU);
    [
        found.motion.x_m - motion.x,
        found.motion.y_m - motion.y,
        (turn - std::f64::consts::PI).to_degrees(),
    ]
}

/// g at (row, col), bilinear; zero outside.
fn value(g: &[f32], n: usize, row: f64, col: f64) -> f64 {
    let last = (n - 1) as f64 + 1e-9;
    if !(0.0..=last).contains(&row) || !(0.0..=last).contains(&col) {
        return 0.0;
    }
    let (i, j) = (
        (row.floor() as usize).min(n - 2),
        (col.floor() as usize).min(n - 2),
    );
    let (a, b) = (row - i as f64, col - j as f64);
    let [p, q, r, s] =
        [(i, j), (i, j + 1), (i + 1, j), (i + 1, j + 1)].map(|(i, j)| f64::from(g[i * n + j]));
    (1.0 - a) * ((1.0 - b) * p + b * q) + a * ((1.0 - b) * r + b * s)
}

/// R x + o, as (row, col).
fn looked_up(n: usize, [row, col]: [isize; 2], (angle_rad, o): (f64, f64)) -> (f64, f64) {
    let ((sin, cos), middle) = (angle_rad.sin_cos(), (n - 1) as f64 / 2.0);
    let (u, v) = (row as f64 - middle, col as f64 - middle);
    (
        middle + o + cos * u - sin * v,
        middle + o + sin * u + cos * v,
    )
}

/// Sum of f(x) g(R (x + s) + o) over the cells of f, s by whole cells.
fn direct_sum(f: &[f32], g: &[f32], n: usize, turn: (f64, f64), [down, right]: [isize; 2]) -> f64 {
    let inside = |v: isize| (0..n as isize).contains(&v);
    (0..n * n)
        .filter_map(|k| {
            let (row, col) = ((k / n) as isize + down, (k % n) as isize + right);
            let at = looked_up(n, [row, col], turn);
            (inside(row) && inside(col)).then(|| f64::from(f[k]) * value(g, n, at.0, at.1))
        })
        .sum()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]
    #[test]
    fn the_best_of_all_angles_and_shifts_is_that_of_the_direct_sums(
        n in 20_usize..25,
        g in prop::collection::vec(0.0_f32..1.0, 24 * 24),
        (k, down, right) in (-1..=1, -3_isize..=3, -3_isize..=3),
    ) {
        // Angles of 9 degrees, shifts of up to 3 cells of 1 m. f is g seen after one of these
        // motions.
        let g: Vec<f32> = g[..n * n].iter().map(|v| v.powi(4)).collect();
        let angle = |k: i32| (9.0 * f64::from(k)).to_radians();
        let moved = |at: usize| {
            let x = [(at / n) as isize + down, (at % n) as isize + right];
            let (row, col) = looked_up(n, x, (angle(k), 0.0));
            value(&g, n, row, col) as f32
        };
        let f: Vec<f32> = (0..n * n).map(moved).collect();
        let config = ExhaustiveConfig {
            reach_deg: 18.0,
            step_deg: 9.0,
            reach_m: 3.0,
            overlap: Overlap::None,
            peak: Peak::Parabola,
        };
        let raster = |cells: &[f32]| Array2::from_shape_vec((n, n), cells.to_vec()).unwrap();
        let found = search(n, 1.0, &config, &raster(&g), &raster(&f)).motion;
        // Angles are compared by rasters read between the cells, all blurred alike.
        let all = (-2..=2).flat_map(|k| (-3..=3).flat_map(move |i| (-3..=3).map(move |j| (k, [i, j]))));
        let summed = all.map(|(k, s)| (k, s, direct_sum(&f, &g, n, (angle(k), 0.2113), s)));
        let (best, [i, j], _) = summed.max_by(|a, b| a.2.total_cmp(&b.2)).unwrap();
        let turn = nalgebra::Rotation2::new(angle(best));
        let place = turn * nalgebra::Vector2::new(i as f64, j as f64) * -1.0;
        let off = [found.x_m - place.x, found.y_m - place.y];
        let turned = nalgebra::Rotation2::new(found.yaw_rad).rotation_to(&turn).angle().to_degrees();
        prop_assert!(off[0].hypot(off[1]) < 1.3 && turned.abs() < 7.0, "{found:?}: {best} {i} {j}");
    }
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
            let motion = Motion::degrees(1.2, 0.4, yaw_deg);
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
            let motion = Motion::degrees(x_m, y_m, yaw_deg);
            let (earlier, later) = pair(n, cell_m, motion, 300 + k);
            let found = search(n, cell_m, &config, &earlier, &later);
            for (square, error) in squares.iter_mut().zip(errors(&found, motion)) {
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
    let (earlier, later) = pair(127, 0.8, Motion::degrees(0.0, 0.0, 4.0), 9);
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
    let (earlier, later) = pair(65, 0.8, Motion::degrees(1.0, 0.0, 2.0), 1);
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
    let config = ExhaustiveConfig::default();
    let mut exhaustive = ExhaustiveSearch::new(65, 0.8, &config).unwrap();
    let (raster, small) = (Array2::zeros((65, 65)), Array2::zeros((7, 65)));
    let error = exhaustive.search(raster.view(), small.view()).unwrap_err();
    let words = "earlier raster is 7 x 65: expected 65 x 65";
    assert_eq!(error.to_string(), words);
    assert!(exhaustive.search(small.view(), raster.view()).is_err());
    let far = ExhaustiveConfig {
        reach_m: 30.0,
        ..config.clone()
    };
    let error = ExhaustiveSearch::new(65, 0.8, &far).err().unwrap();
    let words = "exhaustive.reach_m is 30, but must be";
    assert!(error.to_string().starts_with(words), "{error}");
    assert!(ExhaustiveSearch::new(3, 0.8, &config).is_err());
    assert!(ExhaustiveSearch::new(65, f64::NAN, &config).is_err());
}

#[test]
fn results_do_not_depend_on_earlier_searches() {
    let (earlier, later) = pair(97, 0.8, Motion::degrees(2.0, -1.0, 5.0), 2);
    let fresh = search(97, 0.8, &ExhaustiveConfig::default(), &earlier, &later);
    let mut used = ExhaustiveSearch::new(97, 0.8, &ExhaustiveConfig::default()).unwrap();
    let bright = Array2::from_elem((97, 97), 5.0);
    for (f, g) in [(&bright, &later), (&later, &bright), (&earlier, &later)] {
        used.search(f.view(), g.view()).unwrap();
    }
    assert_eq!(used.search(later.view(), earlier.view()).unwrap(), fresh);
}
