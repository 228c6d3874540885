//! Edges and levers, pinned by single scatterers.

use crate::common::{draw, scene_aside};
use gyre_matching::{RotationMatch, TranslationConfig, TranslationSearch};

const CELL_M: f64 = 0.5;
const N: usize = 101;

fn known_angle(angle_rad: f64) -> RotationMatch {
    RotationMatch {
        angle_rad,
        variance_rad2: 1e-6,
        score: 1.0,
        runner_up: None,
    }
}

#[test]
fn scatterers_do_not_wrap_around_the_edges() {
    // The only scatterer lies at the near edge before, and is gone after; a second scatterer stands
    // at the far edge only after. Around a circle of n cells they would match at a shift of two
    // cells.
    let (earlier, later) = ([[25.0, 0.0]], [[-24.5, 0.0]]);
    let raster = |points: &[[f64; 2]]| draw(points.iter().map(|&p| (p, 1.0)), N, CELL_M, 0.8);
    let config = TranslationConfig {
        reach_m: 20.0,
        ..TranslationConfig::default()
    };
    let mut translation = TranslationSearch::new(N, CELL_M, &config).unwrap();
    let (later, earlier) = (raster(&later), raster(&earlier));
    let found = translation.search(later.view(), earlier.view(), &known_angle(0.0));
    let found = found.unwrap();
    assert!(found.score < 1e-3, "{found:?}");
}

#[test]
fn the_scene_behind_the_lever_moves_with_the_angle() {
    // All structure 20 m ahead: an angle that is wrong by e moves it to the side, and the shift
    // compensates.
    let raster = draw(scene_aside().into_iter(), N, CELL_M, 1.2);
    let mut translation = TranslationSearch::new(N, CELL_M, &TranslationConfig::default()).unwrap();
    let mut at = |e: f64| {
        translation
            .search(raster.view(), raster.view(), &known_angle(e))
            .unwrap()
    };
    let (plus, minus, middle) = (at(0.01), at(-0.01), at(0.0));
    let slope = [(plus.x_m - minus.x_m) / 0.02, (plus.y_m - minus.y_m) / 0.02];
    let variance = middle.covariance[(2, 2)];
    for (axis, seen) in slope.into_iter().enumerate() {
        let predicted = middle.covariance[(axis, 2)] / variance;
        assert!(
            (predicted - seen).abs() < 1.5,
            "axis {axis}: {predicted} {seen}"
        );
    }
    assert!(slope[1] < -10.0, "{slope:?}");
    assert!(middle.covariance.symmetric_eigenvalues().min() > 0.0);
}
