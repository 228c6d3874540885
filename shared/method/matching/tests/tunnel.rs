//! A tunnel, whose walls look the same everywhere: displacement along it is unobservable.

use crate::common::{Numbers, scenes::*};
use gyre_geometry::{Pose, SparsePoint, pose, samples::Witness};
use gyre_matching::{InitialGuess, Outcome, Refined, Refiner};

const SCANS: usize = 100;
/// The last houses are out of sight.
const INSIDE: usize = 40;
/// Measured distance over the true one.
const SCALE: f64 = 0.99;

fn refine_with(
    refiner: &mut Refiner,
    (drive, scans): (&Drive, &[Vec<SparsePoint>]),
    wheels: impl Fn(usize) -> Option<f64>,
) -> Vec<Refined> {
    let search = search_until(INSIDE, drive);
    refine_searched(refiner, (drive, scans), wheels, search)
}

fn refine_searched(
    refiner: &mut Refiner,
    (drive, scans): (&Drive, &[Vec<SparsePoint>]),
    wheels: impl Fn(usize) -> Option<f64>,
    search: impl FnMut(usize) -> Pose,
) -> Vec<Refined> {
    let distance = |k: usize| wheels(k).map(|factor| by_wheels(drive, k, factor));
    let evidence = |k: usize| evidence_of(Witness::Wheels, distance(k));
    refine_aided(refiner, scans, evidence, search)
}

fn inside(drive: &Drive, refined: &[Refined]) -> (Pose, f64) {
    off(drive, refined, INSIDE..SCANS - 1)
}

fn slid(refined: &Refined) -> bool {
    refined.guess == InitialGuess::AlongWalls
}

#[test]
fn the_wheels_say_how_far_and_the_radar_where_the_walls_are() {
    let drive = slower(SCANS);
    let scans = into_a_tunnel(&drive, Vec::new());
    let mut refiner = refiner();
    let refined = refine_with(&mut refiner, (&drive, &scans), |_| Some(SCALE));
    assert!(!refined[..6].iter().any(slid), "houses tell the way");
    for (k, refined) in refined.iter().enumerate().skip(INSIDE) {
        assert!(
            slid(refined) && refined.outcome == Outcome::Refined,
            "{k}: {refined:?}"
        );
        assert!(refined.motion.covariance.cholesky().is_some());
    }
    let (off, sigma_m) = inside(&drive, &refined);
    // One percent of 140 m; the scale was estimated before.
    assert!(
        off.translation.x.abs() < 1.4 && off.translation.y.abs() < 0.5,
        "{off}"
    );
    assert!(off.rotation.angle().abs() < 5e-3, "{off}");
    assert!(
        off.translation.x.abs() < 3.0 * sigma_m && sigma_m < 2.5,
        "{off}, {sigma_m} m"
    );
}

#[test]
fn radar_alone_says_that_it_does_not_know_how_far() {
    let drive = slower(SCANS);
    let scans = into_a_tunnel(&drive, Vec::new());
    let refined = refine_with(&mut refiner(), (&drive, &scans), |_| None);
    assert!(refined[INSIDE..].iter().all(slid));
    let (off, sigma_m) = inside(&drive, &refined);
    // The estimate keeps its speed, while the vehicle slows down.
    assert!(off.translation.x > 10.0, "{off}");
    assert!(off.translation.x < 3.0 * sigma_m, "{off}, {sigma_m} m");
    assert!(
        off.translation.y.abs() < 0.5 && off.rotation.angle().abs() < 5e-3,
        "{off}"
    );
}

#[test]
fn wheels_that_fall_silent_inside_leave_the_speed_that_they_measured() {
    let drive = slower(SCANS);
    let scans = into_a_tunnel(&drive, Vec::new());
    let mut refiner = refiner();
    let measured = |k: usize| (k < SCANS - 12).then_some(SCALE);
    let refined = refine_with(&mut refiner, (&drive, &scans), measured);
    let (off, sigma_m) = inside(&drive, &refined);
    assert!(
        off.translation.x.abs() < 3.0 && sigma_m > 2.0,
        "{off}, {sigma_m} m"
    );
    assert_eq!(refiner.state().sliding, 12);
}

#[test]
fn one_scan_without_wheels_inside_does_not_ask_the_search() {
    let drive = slower(SCANS);
    let scans = into_a_tunnel(&drive, Vec::new());
    let mut refiner = refiner();
    let measured = |k: usize| (!k.is_multiple_of(5)).then_some(SCALE);
    // It is wrong, but not by so much as to contradict the wheels.
    let search = |k: usize| match k < INSIDE {
        true => searched(&drive, k - 1),
        false => searched(&drive, k - 1) * pose(0.3, 0.0, 0.0),
    };
    let refined = refine_searched(&mut refiner, (&drive, &scans), measured, search);
    let (off, _) = inside(&drive, &refined);
    assert!(refined[INSIDE..].iter().all(slid));
    assert!(off.translation.x.abs() < 1.4, "{off}");
}

/// The map does not distinguish posts beside such walls from speckle, but the search finds them.
#[test]
fn as_long_as_the_search_sees_the_way_it_is_seen() {
    let posts = posts([[0.0, 400.0], [5.0, 30.0]], 15.0, 9);
    let drive = slower(SCANS);
    let scans = into_a_tunnel(&drive, posts);
    let search = |k: usize| searched(&drive, k - 1);
    for wheels in [None, Some(SCALE)] {
        let mut refiner = refiner();
        let refined = refine_searched(&mut refiner, (&drive, &scans), |_| wheels, search);
        let (off, sigma_m) = inside(&drive, &refined);
        assert!(!refined.iter().any(slid));
        assert!(
            off.translation.vector.norm() < 1.0 && sigma_m < 2.0,
            "{off}, {sigma_m} m"
        );
    }
}

/// The vehicle slows down in the tunnel, so that the way through it is guessed too long.
#[test]
fn behind_a_tunnel_the_way_is_seen_again() {
    let drive = Drive {
        acceleration_mps2: -0.12,
        ..Drive::steady(10.0, 0.0, 160)
    };
    let mut scene = town([[-110.0, -10.0], [-60.0, 60.0]], 1);
    scene.extend([3.0, -6.5].map(|y| wall([0.0, y], [250.0, y], 1600)));
    scene.extend(town([[250.0, 400.0], [-60.0, 60.0]], 2));
    let scans = scans(&scene, &drive, &LITTLE_NOISE);
    let mut numbers = Numbers(7);
    let is_inside = |k: usize| (85.0..155.0).contains(&drive.pose(k).translation.x);
    let search = |k: usize| match is_inside(k) {
        true => pose(2.0 + numbers.within(6.0), 0.0, 0.0),
        false => searched(&drive, k - 1),
    };
    let refined = refine_searched(&mut refiner(), (&drive, &scans), |_| None, search);
    let last = refined.iter().rposition(slid).unwrap();
    let from = drive.pose(last + 1);
    assert!((155.0..260.0).contains(&from.translation.x), "{from}");
    let (off, _) = off(&drive, &refined, last + 1..refined.len());
    assert!(off.translation.vector.norm() < 0.5, "{off}");
}
