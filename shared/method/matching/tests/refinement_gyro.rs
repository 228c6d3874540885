//! A gyro that contradicts the radar is not used, as long as it does.

use std::ops::Range;

use gyre_geometry::{
    SparsePoint, pose,
    samples::{GyroConfig, SensorConfigs, Witness},
};
use gyre_matching::{Outcome, Refined, Verdict};

use crate::common::scenes::*;

const SCANS: usize = 60;
const WRONG: Range<usize> = 30..33;

fn bend() -> (Drive, Vec<Vec<SparsePoint>>) {
    let drive = Drive::steady(6.0, 3.0, SCANS);
    let town = town([[-110.0, 220.0], [-110.0, 160.0]], 1);
    (drive, scans(&town, &drive, &NOISY))
}

/// Refines the motions to these scans with a gyro whose rate is off by so much. The search looks
/// for rotations near the gyro's rotation, and finds one at the edge of its range.
fn refine_with(
    gyro: &GyroConfig,
    (drive, scans): (&Drive, &[Vec<SparsePoint>]),
    off_radps: impl Fn(usize) -> f64,
) -> Vec<Refined> {
    const REACH_RAD: f64 = 0.07;
    let mut refiner = refiner_with(&SensorConfigs {
        gyro: gyro.clone(),
        ..SensorConfigs::default()
    });
    let evidence = |k: usize| evidence_of(Witness::Gyro, Some(by_gyro(drive, off_radps(k))));
    let search = |k: usize| {
        let misled_rad = off_radps(k) * SWEEP_S;
        let misled_rad = misled_rad - misled_rad.clamp(-REACH_RAD, REACH_RAD);
        drive.pose(k - 1).inv_mul(&drive.pose(k)) * pose(0.0, 0.0, misled_rad)
    };
    refine_aided(&mut refiner, scans, evidence, search)
}

#[test]
fn a_gyro_is_refused_exactly_where_it_is_wrong_and_the_path_is_that_of_the_radar() {
    let (drive, scans) = bend();
    let good = refine_with(&GyroConfig::default(), (&drive, &scans), |_| 0.0);
    assert_eq!(
        judged(&good, Witness::Gyro, Verdict::Agrees).len(),
        SCANS - 1
    );
    let (undisturbed, _) = off(&drive, &good, 0..SCANS - 1);
    for off_radps in [-3.0, -0.5, 0.5, 1.0, 3.0] {
        let wrong = |k: usize| if WRONG.contains(&k) { off_radps } else { 0.0 };
        let refined = refine_with(&GyroConfig::default(), (&drive, &scans), wrong);
        assert_eq!(
            judged(&refined, Witness::Gyro, Verdict::Refused),
            WRONG.collect::<Vec<_>>(),
            "{off_radps} rad/s"
        );
        let (displacement, _) = off(&drive, &refined, 0..SCANS - 1);
        let apart = undisturbed.inv_mul(&displacement);
        assert!(
            apart.translation.vector.norm() < 0.15,
            "{off_radps} rad/s: {apart}"
        );
        assert!(
            apart.rotation.angle().abs() < 4e-3,
            "{off_radps} rad/s: {apart}"
        );
    }
}

#[test]
fn a_gyro_that_was_refused_last_does_not_turn_a_blind_vehicle() {
    let (drive, mut scans) = bend();
    let blind = WRONG.end..WRONG.end + 4;
    scans[blind.clone()].fill(Vec::new());
    let refined = refine_with(&GyroConfig::default(), (&drive, &scans), |k| {
        if k < WRONG.start { 0.0 } else { 0.5 }
    });
    for k in blind {
        let predicted = &refined[k - 1];
        assert_eq!(predicted.outcome, Outcome::Predicted);
        let off_rad = predicted.motion.motion.rotation.angle() - drive.yaw_rate_radps * SWEEP_S;
        assert!(off_rad.abs() < 0.02, "scan {k}: {off_rad} rad");
    }
    let all: Vec<usize> = (WRONG.start..SCANS).collect();
    assert_eq!(judged(&refined, Witness::Gyro, Verdict::Refused), all);
}

/// A gyro that is wrong once by two degrees, and a scan that is turned by two degrees as a whole:
/// the next match shows which of both errs.
#[test]
fn a_single_error_of_the_gyro_or_of_a_scan_is_doubted_and_the_next_match_decides() {
    let (drive, mut scans) = bend();
    let start = WRONG.start;
    let error_rad = 0.15 * SWEEP_S;
    let wrong_gyro = |k: usize| if k == start { 0.15 } else { 0.0 };
    let by_gyro = refine_with(&GyroConfig::default(), (&drive, &scans), wrong_gyro);
    let (sin, cos) = (error_rad as f32).sin_cos();
    for point in &mut scans[start] {
        let [x, y] = [point.x_m, point.y_m];
        (point.x_m, point.y_m) = (cos * x - sin * y, sin * x + cos * y);
    }
    let by_scan = refine_with(&GyroConfig::default(), (&drive, &scans), |_| 0.0);
    for (refined, refused) in [(&by_gyro, vec![start + 1]), (&by_scan, vec![])] {
        assert_eq!(judged(refined, Witness::Gyro, Verdict::Doubted), [start]);
        assert_eq!(judged(refined, Witness::Gyro, Verdict::Refused), refused);
        let sigma_rad = refined[start - 1].motion.covariance[(2, 2)].sqrt();
        assert!(sigma_rad > 0.8 * error_rad, "{sigma_rad} rad");
        let (displacement, _) = off(&drive, refined, 0..SCANS - 1);
        assert!(displacement.rotation.angle().abs() < 4e-3, "{displacement}");
    }
    // The motion that takes the error of the gyro back has it too.
    let sigma_rad = by_gyro[start].motion.covariance[(2, 2)].sqrt();
    assert!(sigma_rad > 0.8 * error_rad, "{sigma_rad} rad");
    let turn_rad = by_scan[start - 1].motion.motion.rotation.angle();
    let off_rad = turn_rad - drive.yaw_rate_radps * SWEEP_S;
    assert!(off_rad.abs() < 0.1 * error_rad, "{off_rad} rad");
}

#[test]
fn a_gyro_whose_learnt_scale_is_implausible_is_not_used_any_more() {
    let (drive, scans) = bend();
    let config = GyroConfig {
        bias_sigma_radps: 0.0,
        ..GyroConfig::default()
    };
    for (by, is_refused) in [(0.03, false), (-0.06, true), (0.06, true)] {
        let off_radps = |_| by * drive.yaw_rate_radps;
        let refined = refine_with(&config, (&drive, &scans), off_radps);
        let refused = judged(&refined, Witness::Gyro, Verdict::Refused);
        let from = refused.first().map_or(SCANS, |first| *first);
        assert_eq!(refused, (from..SCANS).collect::<Vec<_>>(), "{by}");
        assert_eq!(from < SCANS, is_refused, "{by}: {from}");
    }
}
