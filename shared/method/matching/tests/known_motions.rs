//! Motions put into generated scenes come out of the search.

use crate::common::{Numbers, errors, pair, pair_of, pose_deg, search};
use gyre_geometry::Pose;
use gyre_matching::{
    MotionMatch, Overlap, Peak, RotationConfig, RotationForm, Taper, TranslationConfig,
};

type Configs = (RotationConfig, TranslationConfig);

fn recovered(n: usize, cell_m: f64, configs: &Configs, motion: Pose, seed: u64) -> MotionMatch {
    let (earlier, later) = pair(n, cell_m, motion, seed);
    search(n, cell_m, configs, &earlier, &later).1
}

#[test]
fn whole_range_of_angles_and_shifts_to_a_fraction_of_a_cell() {
    let (n, cell_m, mut numbers) = (255, 0.4, Numbers(7));
    let (mut worst, mut squares, pairs) = ([0.0_f64; 3], [0.0; 3], 40);
    for k in 0..pairs {
        let [x_m, y_m, yaw_deg] = [8.0, 8.0, 19.5].map(|limit| numbers.within(limit));
        let motion = pose_deg(x_m, y_m, yaw_deg);
        let found = recovered(n, cell_m, &Configs::default(), motion, 100 + k);
        for (axis, error) in errors(&found, &motion).into_iter().enumerate() {
            worst[axis] = worst[axis].max(error.abs());
            squares[axis] += error * error / pairs as f64;
        }
    }
    let rms = squares.map(f64::sqrt);
    let is_within = |errors: &[f64; 3], cells: f64, degrees: f64| {
        errors[0].max(errors[1]) < cells * cell_m && errors[2] < degrees
    };
    assert!(is_within(&rms, 0.1, 0.08), "RMS {rms:?} (m, m, deg)");
    assert!(is_within(&worst, 0.5, 0.3), "worst {worst:?} (m, m, deg)");
}

#[test]
fn shifts_up_to_the_reach_are_found_in_every_direction() {
    for (x, y) in [
        (11.9, 0.0),
        (-11.9, 0.0),
        (0.0, 11.9),
        (0.0, -11.9),
        (11.6, -11.6),
    ] {
        let motion = pose_deg(x, y, 0.0);
        let [dx, dy, _] = errors(
            &recovered(255, 0.4, &Configs::default(), motion, 5),
            &motion,
        );
        assert!(dx.abs() < 0.2 && dy.abs() < 0.2, "{x} {y}: {dx} {dy}");
    }
}

#[test]
fn every_form_of_the_search_finds_the_motion() {
    let motion = pose_deg(2.3, -0.7, 6.4);
    let (rotation, translation) = Configs::default();
    // Weston et al., Algorithm 1, and phase correlation (Checchin et al., Algorithm 1).
    let line14 = RotationConfig {
        form: RotationForm::ProfileMean,
        window: Taper::Hann,
        angles: 733,
        peak: Peak::Parabola,
        ..rotation.clone()
    };
    let plain = TranslationConfig {
        overlap: Overlap::None,
        peak: Peak::Parabola,
        ..translation.clone()
    };
    let phase = RotationConfig {
        phase_only: true,
        ..rotation.clone()
    };
    let phase_shift = TranslationConfig {
        phase_only: true,
        ..translation.clone()
    };
    let forms: [(&str, Configs, [f64; 2]); 3] = [
        ("default", (rotation, translation), [0.1, 0.1]),
        ("Weston et al.", (line14, plain), [0.4, 1.0]),
        ("Checchin et al.", (phase, phase_shift), [0.4, 1.0]),
    ];
    for (name, configs, [metres, degrees]) in forms {
        let [dx, dy, dyaw] = errors(&recovered(255, 0.4, &configs, motion, 3), &motion);
        assert!(
            dx.abs() < metres && dy.abs() < metres && dyaw.abs() < degrees,
            "{name}: {dx} {dy} {dyaw}"
        );
        // Scores are correlation coefficients, exact where a parabola goes through the highest one.
        let (same, _) = pair(255, 0.4, motion, 3);
        let (angle, shift) = search(255, 0.4, &configs, &same, &same);
        let is_one = |score: f64| (score - 1.0).abs() < 1e-3;
        assert!(
            angle.angle_rad.abs() < 1e-4 && is_one(angle.score),
            "{name}"
        );
        let is_exact = configs.1.peak == Peak::Parabola;
        assert!(!is_exact || is_one(shift.score), "{name}: {shift:?}");
    }
}

#[test]
fn odd_and_even_rasters_of_any_size() {
    let motion = pose_deg(1.1, 0.6, -4.0);
    for n in [97, 127, 128, 200, 511] {
        let [dx, dy, dyaw] = errors(&recovered(n, 0.4, &Configs::default(), motion, 11), &motion);
        assert!(
            dx.abs() < 0.2 && dy.abs() < 0.2 && dyaw.abs() < 0.5,
            "{n}: {dx} {dy} {dyaw}"
        );
    }
}

/// A field that fills the raster: what shrinks with the shift is the overlap alone.
#[test]
fn energy_normalisation_removes_the_bias_toward_zero_shift() {
    let (n, cell_m, motion) = (127, 0.4, pose_deg(8.0, 0.0, 0.0));
    let mean_error = |overlap: Overlap| {
        let config = TranslationConfig {
            overlap,
            ..TranslationConfig::default()
        };
        let configs = (RotationConfig::default(), config);
        let error = |seed: u64| {
            let scene = crate::common::scatterers(5000, 60.0, 900 + seed);
            let (earlier, later) = pair_of(&scene, n, cell_m, 2.5, motion);
            search(n, cell_m, &configs, &earlier, &later).1.x_m - motion.translation.x
        };
        (0..12).map(error).sum::<f64>() / 12.0
    };
    let [none, energy] = [Overlap::None, Overlap::Energy].map(mean_error);
    assert!(none < -0.05, "no bias to remove: {none}");
    assert!(energy.abs() < 0.25 * none.abs(), "{none} {energy}");
}
