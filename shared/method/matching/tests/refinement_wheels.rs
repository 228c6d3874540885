//! A vehicle with a gyro and wheels continues where the radar is blind.

use std::ops::Range;

use crate::common::scenes::*;
use gyre_geometry::{SparsePoint, pose, samples::Witness};
use gyre_matching::{Outcome, Refined, Refiner, Verdict};

const SCANS: usize = 100;
/// Six seconds.
const BLIND: Range<usize> = 60..84;
const BIAS_RADPS: f64 = 0.004;
/// Measured distance over the true one.
const SCALE: f64 = 0.99;

/// A vehicle that accelerates all the time, so that its earlier speed is a poor prediction, and its
/// scans.
fn faster() -> (Drive, Vec<Vec<SparsePoint>>) {
    let drive = Drive {
        acceleration_mps2: 0.4,
        ..Drive::steady(6.0, 0.0, SCANS)
    };
    let town = town([[-110.0, 400.0], [-110.0, 110.0]], 1);
    (drive, scans(&town, &drive, &NOISY))
}

/// Refines the motions to these scans, while the wheels measure the true distance times a factor.
fn refine_with(
    refiner: &mut Refiner,
    (drive, scans): (&Drive, &[Vec<SparsePoint>]),
    measured: impl Fn(usize) -> Option<f64>,
    turns: bool,
) -> Vec<Refined> {
    let evidence = |k: usize| {
        let distance = measured(k).map(|factor| by_wheels(drive, k, factor));
        let mut all = evidence_of(Witness::Wheels, distance);
        if turns {
            all[Witness::Gyro as usize] = by_gyro(drive, BIAS_RADPS);
        }
        all
    };
    // The search finds nothing where there is nothing.
    let search = |k: usize| match BLIND.contains(&k) || BLIND.contains(&(k - 1)) {
        true => pose(-3.0, 4.0, 0.5),
        false => drive.pose(k - 1).inv_mul(&drive.pose(k)),
    };
    refine_aided(refiner, scans, evidence, search)
}

#[test]
fn a_blind_radar_is_bridged_by_gyro_and_wheels_whatever_it_shows() {
    let (drive, good) = faster();
    for fault in ["nothing", "noise"] {
        let mut scans = good.clone();
        for k in BLIND {
            scans[k] = match fault {
                "nothing" => Vec::new(),
                _ => noise(k as u64),
            };
        }
        let both = refine_with(&mut refiner(), (&drive, &scans), |_| Some(SCALE), true);
        let around = BLIND.start - 2..BLIND.end + 2;
        let (off_by, _) = off(&drive, &both, around.clone());
        // 80 m: half a percent.
        assert!(off_by.translation.vector.norm() < 0.4, "{fault}: {off_by}");
        for (k, refined) in (1..).zip(&both) {
            // The scan after the blind ones starts a map, and the next one matches it.
            let expected = match (BLIND.start..=BLIND.end).contains(&k) {
                true => Outcome::Predicted,
                false => Outcome::Refined,
            };
            assert_eq!(refined.outcome, expected, "{fault}, scan {k}");
            assert!(refined.motion.covariance.cholesky().is_some());
        }
        // No jump where the radar sees again.
        let (seen, _) = off(&drive, &both, BLIND.end..BLIND.end + 3);
        assert!(seen.translation.vector.norm() < 0.15, "{fault}: {seen}");
        let scale = both[SCANS - 2].witnesses[Witness::Wheels as usize].unwrap();
        let apart = scale.scale - 1.0 / SCALE;
        assert!(
            apart.abs() < 3.0 * scale.scale_sigma && scale.scale_sigma < 3e-3,
            "{scale:?}"
        );
        let alone = refine_with(&mut refiner(), (&drive, &scans), |_| None, false);
        let (alone, _) = off(&drive, &alone, around);
        assert!(alone.translation.vector.norm() > 1.0, "{fault}: {alone}");
    }
}

#[test]
fn wheels_that_slip_change_no_motion_while_the_radar_sees() {
    let (drive, scans) = faster();
    let slip = |k: usize| Some(if (40..46).contains(&k) { 1.5 } else { 1.0 });
    let slipping = refine_with(&mut refiner(), (&drive, &scans), slip, true);
    let slips = judged(&slipping, Witness::Wheels, Verdict::Refused);
    assert_eq!(slips, (40..46).collect::<Vec<_>>());
    let (whole, _) = off(&drive, &slipping, 0..SCANS - 1);
    assert!(whole.translation.vector.norm() < 0.5, "{whole}");
    // Where the search finds nothing they are weak.
    assert!(slipping.iter().all(|it| it.outcome != Outcome::Predicted));
}

#[test]
fn a_vehicle_that_stands_drives_off_while_the_radar_is_blind() {
    let standing = Drive::steady(0.0, 0.0, SCANS);
    let town = town([[-110.0, 110.0], [-110.0, 110.0]], 1);
    let mut scans = scans(&town, &standing, &NOISY);
    scans[BLIND.start..].fill(Vec::new());
    let moving = Drive::steady(4.0, 0.0, SCANS);
    let measured = |k: usize| Some(if k < BLIND.start { 0.0 } else { 1.0 });
    let refined = refine_with(&mut refiner(), (&moving, &scans), measured, false);
    let (stood, drove) = refined.split_at(BLIND.start - 1);
    assert!(stood.iter().skip(8).all(|it| it.stationary));
    assert!(drove.iter().all(|it| !it.stationary));
    let driven_m: f64 = drove.iter().map(|it| it.motion.motion.translation.x).sum();
    let expected_m = drove.len() as f64;
    assert!(
        (driven_m / expected_m - 1.0).abs() < 0.05,
        "{driven_m} of {expected_m}"
    );
}
