//! Faults of a few scans do not corrupt the refined trajectory, and a restored refiner continues
//! bit for bit.

use crate::common::scenes::*;
use gyre_geometry::{ComposedMotion, Pose, SparsePoint};
use gyre_matching::{Outcome, Refined, Refiner, Searched};

/// A gentle bend and its 60 scans.
fn bend() -> (Drive, Vec<Vec<SparsePoint>>) {
    let drive = Drive::steady(10.0, 4.0, 60);
    (
        drive,
        scans(&town([[-110.0, 250.0], [-110.0, 200.0]], 1), &drive, &NOISY),
    )
}

fn bits(refined: &[Refined]) -> Vec<u64> {
    let numbers = |refined: &Refined| {
        let (position, turn) = (
            refined.motion.motion.translation,
            refined.motion.motion.rotation,
        );
        let pose = [position.x, position.y, turn.re, turn.im];
        let outcome = f64::from(refined.outcome as u8) + 0.1 * f64::from(refined.guess as u8);
        let covariance = refined.motion.covariance;
        let rest = [refined.overlap, refined.support, outcome];
        [&pose[..], covariance.as_slice(), &rest].concat()
    };
    refined.iter().flat_map(numbers).map(f64::to_bits).collect()
}

/// Asserts that a result is finite and that a vehicle can have driven it.
#[track_caller]
fn sane(refined: &Refined) {
    let (motion, covariance) = (refined.motion.motion, refined.motion.covariance);
    let sane = motion.translation.vector.iter().all(|v| v.abs() < 10.0)
        && motion.rotation.angle().abs() < 1.0
        && covariance.iter().all(|v| v.is_finite())
        && covariance.cholesky().is_some()
        && (0.0..=1.0).contains(&refined.overlap)
        && refined.support.is_finite();
    assert!(sane, "{refined:?}");
}

#[test]
fn a_fault_of_one_scan_is_bridged() {
    let (drive, good) = bend();
    let before = refine(&drive, &good).errors();
    let turned: Vec<SparsePoint> = good[30]
        .iter()
        .map(|p| SparsePoint {
            x_m: -p.y_m,
            y_m: p.x_m,
            ..*p
        })
        .collect();
    let half: Vec<SparsePoint> = good[30].iter().filter(|p| p.y_m > 0.0).copied().collect();
    let faults = [
        ("noise", noise(1), Outcome::Predicted),
        ("turned", turned, Outcome::Predicted),
        ("half", half, Outcome::Weak),
    ];
    for (name, fault, expected) in faults {
        let mut scans = good.clone();
        scans[30] = fault;
        let run = refine(&drive, &scans);
        let errors = run.errors();
        for (k, refined) in run.refined.iter().enumerate() {
            let expected = if k == 29 { expected } else { Outcome::Refined };
            assert_eq!(refined.outcome, expected, "{name}, motion {k}");
            sane(refined);
        }
        let is_near = errors.shift_m < before.shift_m + 0.1
            && errors.yaw_deg.abs() < before.yaw_deg.abs() + 0.1;
        assert!(is_near, "{name}: {errors:?}, without {before:?}");
    }
}

/// The large error of a prediction does not stay: the next match takes it back.
#[test]
fn the_covariance_of_a_pose_recovers_after_a_prediction() {
    let (drive, mut scans) = bend();
    scans[30] = noise(1);
    let run = refine(&drive, &scans);
    assert_eq!(run.refined[29].outcome, Outcome::Predicted);
    let mut composed = ComposedMotion::default();
    let variances_m2 = run.refined.iter().map(|refined| {
        composed = composed.then(&refined.motion);
        composed.motion.covariance[(0, 0)]
    });
    let variances_m2: Vec<f64> = variances_m2.collect();
    let of_prediction = run.refined[29].motion.covariance[(0, 0)];
    let gained = |k: usize| variances_m2[k] - variances_m2[28];
    assert!(gained(29) > 0.4 * of_prediction, "{variances_m2:?}");
    let by_three_motions = 3.0 * (variances_m2[28] - variances_m2[8]) / 20.0;
    assert!(gained(31) < 2.0 * by_three_motions, "{variances_m2:?}");
    // The motion back to the true pose takes in the error of the prediction.
    assert!(run.refined[30].motion.covariance[(0, 0)] > of_prediction);
}

/// The new map starts with noise, since the first pair is always accepted. A few scans and the
/// heading are lost: the trajectory before and the one after are right, each in itself.
#[test]
fn after_enough_scans_of_noise_a_new_map_starts() {
    const FIRST: usize = 29;
    const RECOVERED: usize = 10;
    const MAX_UNMATCHED: usize = 5;
    let (drive, good) = bend();
    for seed in 0..4 {
        let mut scans = good.clone();
        (0..MAX_UNMATCHED).for_each(|k| scans[FIRST + 1 + k] = noise(100 * seed + k as u64));
        let (mut refiner, last) = (refiner(), FIRST + MAX_UNMATCHED - 1);
        let mut refined = refine_on(&mut refiner, &drive, &scans, 0..last);
        assert!(refiner.keyframes().count() > 0);
        refined.extend(refine_on(&mut refiner, &drive, &scans, last..last + 1));
        assert_eq!(refiner.keyframes().count(), 0);
        let are =
            |refined: &[Refined], outcome: Outcome| refined.iter().all(|it| it.outcome == outcome);
        assert!(are(&refined[FIRST..], Outcome::Predicted));
        refined.extend(refine_on(&mut refiner, &drive, &scans, last + 1..59));
        let run = Run { drive, refined };
        let after = run.errors_from(last + 1 + RECOVERED);
        let recovered = &run.refined[last + 1 + RECOVERED..];
        assert!(are(recovered, Outcome::Refined));
        assert!(
            after.shift_m < 0.3 && after.yaw_deg.abs() < 0.25,
            "{after:?}"
        );
        run.refined.iter().for_each(sane);
    }
}

#[test]
fn no_points_give_a_motion_that_is_not_finite() {
    let (drive, good) = bend();
    let weightless = |p: &SparsePoint| SparsePoint { weight: 0.0, ..*p };
    let infinite = [f64::INFINITY, 1.0, 0.0, 1.0, 0.0];
    let faults: [(&str, Vec<SparsePoint>); 5] = [
        ("none", Vec::new()),
        ("nan", vec![point([f64::NAN; 5]); 500]),
        ("infinite", vec![point(infinite); 500]),
        ("weightless", good[30].iter().map(weightless).collect()),
        ("at the sensor", vec![point([0.0; 5]); 500]),
    ];
    for (name, fault) in faults {
        // In the middle of a drive, at its start, and in all scans.
        for range in [30..31, 0..1, 0..60] {
            let mut scans = good.clone();
            scans[range.clone()].fill(fault.clone());
            let run = refine(&drive, &scans);
            run.refined.iter().for_each(sane);
            if range == (30..31) {
                assert_eq!(run.refined[29].outcome, Outcome::Predicted, "{name}");
                let mut after = run.refined[30..].iter();
                assert!(after.all(|it| it.outcome == Outcome::Refined), "{name}");
                assert!(run.errors().shift_m < 0.4, "{name}: {:?}", run.errors());
            }
        }
    }
}

/// The points of a radar that is nearly blind do not determine a pose, and rounding may
/// make their covariance none.
#[test]
fn a_handful_of_points_gives_a_covariance() {
    let (drive, good) = bend();
    for points in [1, 2, 3, 5] {
        for seed in 0..3 {
            let mut scans = good[..40].to_vec();
            for (k, scan) in scans.iter_mut().enumerate().skip(20) {
                let mut few = noise(1000 * seed + k as u64);
                few.truncate(points);
                *scan = few;
            }
            for refined in refine(&drive, &scans).refined {
                let covariance = refined.motion.covariance;
                assert!(covariance.cholesky().is_some(), "{points}: {covariance}");
            }
        }
    }
}

#[test]
fn stamps_that_do_not_advance_are_bridged() {
    let (drive, scans) = bend();
    for interval_s in [0.0, -1.0, f64::NAN] {
        let mut refiner = refiner();
        let mut refined = refine_on(&mut refiner, &drive, &scans, 0..20);
        let search = searched(&drive, 20);
        refined.push(refiner.refine(&Searched::by_radar(
            21, &scans[21], &scans[20], &search, interval_s,
        )));
        refined.extend(refine_on(&mut refiner, &drive, &scans, 21..59));
        let run = Run { drive, refined };
        run.refined.iter().for_each(sane);
        let errors = run.errors();
        assert!(errors.shift_m < 0.5, "interval {interval_s}: {errors:?}");
    }
}

fn restored(from: &Refiner, mut into: Refiner) -> Refiner {
    let mut keyframes = from.keyframes();
    into.restore(*from.state(), |to| {
        let Some(from) = keyframes.next() else {
            return false;
        };
        (to.id, to.pose) = (from.id, from.pose);
        for ((corner, mut cells), (from_corner, from_cells)) in
            to.images_mut().into_iter().zip(from.images())
        {
            *corner = from_corner;
            cells.assign(&from_cells);
        }
        true
    });
    into
}

#[test]
fn a_restored_refiner_continues_bit_for_bit() {
    let (drive, mut scans) = bend();
    scans[31] = noise(2); // leaves a doubtful scan in the state
    for cut in [1, 7, 31, 45] {
        let (mut one, mut used) = (refiner(), refiner());
        refine_on(&mut one, &drive, &scans, 0..cut);
        refine_on(&mut used, &drive, &scans, 5..25);
        let mut others = [restored(&one, refiner()), restored(&one, used)];
        let expected = bits(&refine_on(&mut one, &drive, &scans, cut..59));
        for other in &mut others {
            let continued = bits(&refine_on(other, &drive, &scans, cut..59));
            assert_eq!(continued, expected, "from scan {cut}");
        }
    }
}

#[test]
fn a_chain_may_start_with_any_scan_number() {
    let (drive, scans) = bend();
    let mut refiner = refiner();
    let refined = refiner.refine(&Searched::by_radar(
        0,
        &scans[1],
        &scans[0],
        &searched(&drive, 0),
        SWEEP_S,
    ));
    sane(&refined);
    let off = drive.pose(1).inv_mul(&refined.motion.motion);
    assert!(off.translation.vector.norm() < 0.2 && refiner.state().pose != Pose::identity());
}

/// A scan that is turned as a whole by an angle that a vehicle can turn, as by a slip of the
/// encoder: the covariances of the motions to it and from it have the jump.
#[test]
fn a_scan_that_is_turned_as_a_whole_widens_the_covariance() {
    let (drive, mut scans) = bend();
    let sigmas = |scans: &[Vec<SparsePoint>]| -> Vec<f64> {
        let refined = refine(&drive, scans).refined;
        refined
            .iter()
            .map(|it| it.motion.covariance[(2, 2)].sqrt())
            .collect()
    };
    let before = sigmas(&scans);
    let jump_rad = 6.6_f64.to_radians();
    let (sin, cos) = (jump_rad as f32).sin_cos();
    for point in &mut scans[30] {
        let [x, y] = [point.x_m, point.y_m];
        (point.x_m, point.y_m) = (cos * x - sin * y, sin * x + cos * y);
    }
    let after = sigmas(&scans);
    assert!(before.iter().all(|sigma| *sigma < 0.02), "{before:?}");
    assert!(
        after[29..31].iter().all(|sigma| *sigma > 0.7 * jump_rad),
        "{after:?}"
    );
    assert!(after[33..].iter().all(|sigma| *sigma < 0.02), "{after:?}");
}

#[test]
fn the_variance_of_a_predicted_pose_grows_with_the_square_of_the_predictions() {
    let drive = Drive::steady(10.0, 0.0, 14);
    let scene = town([[-110.0, 200.0], [-60.0, 60.0]], 1);
    let scans = scans(&scene, &drive, &NOISY);
    let mut refiner = refiner();
    let mut variances = Vec::new();
    for k in 1..scans.len() {
        let later: &[_] = if k < 10 { &scans[k] } else { &[] };
        let search = searched(&drive, k - 1);
        let refined = refiner.refine(&Searched::by_radar(
            k as u64,
            later,
            &scans[k - 1],
            &search,
            SWEEP_S,
        ));
        assert_eq!(refined.outcome == Outcome::Predicted, k >= 10, "{k}");
        if k >= 10 {
            variances.push(refined.motion.covariance[(0, 0)]);
        }
    }
    // A motion has the errors of both of its poses.
    for (n, variance) in (1..).zip(&variances) {
        let (times, expected) = (variance / variances[0], n * n + (n - 1) * (n - 1));
        assert!((times - f64::from(expected)).abs() < 1e-9, "{n}: {times}");
    }
}
