//! The velocity by Doppler, as a witness of the way.

use gyre_geometry::{
    SparsePoint,
    samples::{DopplerKind, Evidence, SensorConfigs, Witness},
};
use gyre_matching::{InitialGuess, Outcome, Refined, Refiner, Verdict, Witnessed};

use crate::common::{Numbers, scenes::*};

const SCANS: usize = 100;
/// From there on there is nothing but walls, or nothing that matches.
const INSIDE: usize = 40;
/// Measured velocity over the true one.
const SCALE: f64 = 0.98;
const SIGMA_MPS: f64 = 0.05;

fn witnessed() -> Refiner {
    let mut sensors = SensorConfigs::default();
    sensors.doppler.kind = DopplerKind::Auto;
    refiner_with(&sensors)
}

fn doppler(refined: &Refined) -> Option<Witnessed> {
    refined.witnesses[Witness::Doppler as usize]
}

/// Refines the motions to these scans. Each scan measures the true velocity times a factor, with
/// noise; scans without a factor measure no velocity. From `INSIDE` on the search finds any way.
fn refine_with(
    refiner: &mut Refiner,
    (drive, scans): (&Drive, &[Vec<SparsePoint>]),
    factor: impl Fn(usize) -> Option<f64>,
) -> Vec<Refined> {
    let velocity = |k: usize| {
        let mut numbers = Numbers(0xd0 + k as u64);
        let mut noise_mps = || SIGMA_MPS * 3.0_f64.sqrt() * numbers.within(1.0);
        let speed_mps = factor(k)? * drive.speed(k as f64 * SWEEP_S);
        Some(Evidence {
            samples: 200,
            interval_s: 0.0,
            value: [speed_mps + noise_mps(), noise_mps()],
            covariance: [SIGMA_MPS.powi(2), 0.0, SIGMA_MPS.powi(2)],
        })
    };
    let evidence = |k: usize| evidence_of(Witness::Doppler, velocity(k));
    refine_aided(refiner, scans, evidence, search_until(INSIDE, drive))
}

#[test]
fn in_a_tunnel_doppler_says_how_far() {
    let drive = slower(SCANS);
    let scans = into_a_tunnel(&drive, Vec::new());
    let refined = refine_with(&mut witnessed(), (&drive, &scans), |_| Some(SCALE));
    for (k, refined) in refined.iter().enumerate().skip(INSIDE) {
        let slid = refined.guess == InitialGuess::AlongWalls;
        assert!(slid && refined.outcome == Outcome::Refined, "{k}");
        assert!(refined.motion.covariance.cholesky().is_some());
    }
    let (off, sigma_m) = off(&drive, &refined, INSIDE..SCANS - 1);
    // Two percent of 140 m; the scale was estimated before.
    assert!(off.translation.x.abs() < 2.8, "{off}");
    assert!(off.translation.x.abs() < 3.0 * sigma_m && sigma_m < 3.0);
    let scale = doppler(&refined[SCANS - 2]).unwrap();
    let apart = scale.scale - 1.0 / SCALE;
    assert!(apart.abs() < 3.0 * scale.scale_sigma, "{scale:?}");
    assert!(
        scale.scale_sigma < 0.015 && scale.verdict == Verdict::Agrees,
        "{scale:?}"
    );
}

#[test]
fn scans_that_match_nothing_are_bridged_by_doppler_alone() {
    let drive = slower(SCANS);
    let town = town([[-110.0, 400.0], [-110.0, 110.0]], 1);
    let mut scans = scans(&town, &drive, &NOISY);
    scans[INSIDE..INSIDE + 24].fill(Vec::new());
    let refined = refine_with(&mut witnessed(), (&drive, &scans), |_| Some(SCALE));
    let blind = INSIDE - 1..INSIDE + 23;
    assert!(
        refined[blind.clone()]
            .iter()
            .all(|it| it.outcome == Outcome::Predicted)
    );
    let (away, sigma_m) = off(&drive, &refined, blind.clone());
    // Two percent of 50 m.
    assert!(away.translation.x.abs() < 1.0, "{away}");
    assert!(away.translation.x.abs() < 3.0 * sigma_m && sigma_m < 1.5);
    let alone = refine_with(&mut witnessed(), (&drive, &scans), |_| None);
    let (alone, _) = off(&drive, &alone, blind);
    assert!(alone.translation.x.abs() > 3.0, "{alone}");
}

#[test]
fn a_velocity_that_a_certain_match_contradicts_is_refused_and_changes_no_motion() {
    let drive = slower(SCANS);
    let town = town([[-110.0, 400.0], [-110.0, 110.0]], 1);
    let scans = &scans(&town, &drive, &NOISY)[..INSIDE];
    // Beside a bus, which fills most bearings.
    let captured = |k: usize| Some(if (20..26).contains(&k) { 1.5 } else { 1.0 });
    let refined = refine_with(&mut witnessed(), (&drive, scans), captured);
    let refused = judged(&refined, Witness::Doppler, Verdict::Refused);
    // The way from the last of them has half of its error, which is within the gate once the
    // vehicle is slow.
    assert!(
        refused.starts_with(&[20, 21, 22, 23, 24, 25]),
        "{refused:?}"
    );
    assert!(refused.len() <= 7, "{refused:?}");
    let without = refine_with(&mut witnessed(), (&drive, scans), |_| None);
    for (with, without) in refined.iter().zip(&without) {
        let apart = with.motion.motion.inv_mul(&without.motion.motion);
        assert!(apart.translation.vector.norm() < 0.02, "{apart}");
    }
}

#[test]
fn without_the_section_velocities_change_no_bit() {
    let drive = slower(SCANS);
    let scans = &into_a_tunnel(&drive, Vec::new())[..INSIDE + 20];
    let poses = |refined: &[Refined]| -> Vec<_> {
        refined
            .iter()
            .map(|it| (it.motion.motion, it.motion.covariance, doppler(it)))
            .collect()
    };
    let told = refine_with(&mut refiner(), (&drive, scans), |_| Some(1.0));
    let alone = refine_with(&mut refiner(), (&drive, scans), |_| None);
    assert_eq!(poses(&told), poses(&alone));
}
