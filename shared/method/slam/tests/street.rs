//! Localisation on a street of posts: found at any heading, tracked, lost outside the map, found
//! again.

use std::f64::consts::PI;

use gyre_geometry::{Pose, SparsePoint, Twist, UncertainMotion, pose};
use gyre_matching::RefinementConfig;
use gyre_slam::{
    Keyframe, RecordLog,
    localisation::{Fix, Localisation, Localiser, Map, Observation, Status},
};
use nalgebra::{Matrix3, Point2};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::common::assert_refused;

const REACH_M: f64 = 90.0;
const CAPACITY: usize = 2048;
const PERIOD_NS: i64 = 250_000_000;

/// Posts along 800 m of a street, at random places and of random strength.
fn street() -> Vec<(Point2<f64>, f32)> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut random = || rng.random::<f64>();
    let mut post = || {
        let aside_m = (6.0 + 30.0 * random()) * if random() < 0.5 { -1.0 } else { 1.0 };
        let place = Point2::new(-100.0 + 800.0 * random(), aside_m);
        (place, 0.3 + 0.7 * random() as f32)
    };
    (0..3000).map(|_| post()).collect()
}

fn seen(street: &[(Point2<f64>, f32)], at: &Pose) -> Vec<SparsePoint> {
    let local = street
        .iter()
        .map(|(place, weight)| (at.inverse_transform_point(place), *weight));
    local
        .filter(|(place, _)| place.coords.norm() < REACH_M)
        .map(|(place, weight)| {
            SparsePoint::from([place.x as f32, place.y as f32, 0.0, weight, 0.0])
        })
        .collect()
}

fn uncertain(motion: Pose) -> UncertainMotion {
    let covariance = Matrix3::from_diagonal(&nalgebra::Vector3::new(1e-4, 1e-4, 1e-6));
    UncertainMotion { motion, covariance }
}

/// The map of the first 300 m.
fn map(street: &[(Point2<f64>, f32)]) -> Map {
    let poses: Vec<Pose> = (0..=150)
        .map(|k| pose(2.0 * f64::from(k), 0.0, 0.0))
        .collect();
    let keyframe = |(k, at): (usize, &Pose)| Keyframe {
        stamp_ns: k as i64 * PERIOD_NS,
        motion: uncertain(pose(2.0, 0.0, 0.0)),
        path_m: 2.0 * k as f64,
        ..Keyframe::standing(k as u64, uncertain(*at), seen(street, at))
    };
    Map::new(poses.iter().enumerate().map(keyframe).collect()).unwrap()
}

fn localiser(street: &[(Point2<f64>, f32)]) -> Localiser {
    Localiser::new(map(street), &RefinementConfig::default(), CAPACITY).unwrap()
}

/// Localises scans at some poses, one after the other, with their true motions.
fn drive(
    localiser: &mut Localiser,
    street: &[(Point2<f64>, f32)],
    poses: &[Pose],
) -> Vec<Localisation> {
    let mut before = poses[0];
    let mut locate = |(k, at): (usize, &Pose)| {
        let motion = uncertain(before.inv_mul(at));
        before = *at;
        localiser.locate(&Observation {
            stamp_ns: k as i64 * PERIOD_NS,
            points: &seen(street, at),
            twist: Twist::default(),
            motion,
        })
    };
    poses.iter().enumerate().map(&mut locate).collect()
}

fn assert_near(fix: Option<Fix>, truth: &Pose) {
    let fix = fix.unwrap_or_else(|| panic!("{truth} is not found"));
    let error = fix.pose.error(truth);
    assert!(
        error.xy().norm() < 0.1 && error.z.abs() < 0.005,
        "{truth}: {error}"
    );
}

#[test]
fn a_scan_is_found_at_any_heading_and_no_other_street_is_taken_for_it() {
    let street = street();
    let mut localiser = localiser(&street);
    for (x, y, heading) in [
        (41.0, 0.4, 0.0),
        (120.3, 1.5, PI),
        (200.7, -1.0, 2.0),
        (250.0, 0.0, -1.2),
    ] {
        let at = pose(x, y, heading);
        assert_near(localiser.find(&seen(&street, &at), &Twist::default()), &at);
    }
    // The street turned over has other distances between its posts.
    let mirrored: Vec<_> = street
        .iter()
        .map(|(p, w)| (Point2::new(p.x, -p.y), *w))
        .collect();
    for x in [50.0, 150.0, 250.0] {
        let at = pose(x, 0.0, 0.3);
        assert_eq!(
            localiser.find(&seen(&mirrored, &at), &Twist::default()),
            None
        );
    }
}

#[test]
fn a_drive_is_tracked_and_lost_three_seconds_after_it_has_left_the_map() {
    let street = street();
    let mut localiser = localiser(&street);
    // The opposite lane at 10 m/s, and on beyond the map's beginning, where there are posts too.
    let poses: Vec<Pose> = (0..60)
        .map(|k| pose(110.0 - 2.5 * f64::from(k), 3.0, PI))
        .collect();
    let found = drive(&mut localiser, &street, &poses);
    assert_eq!(found[0].status, Status::Found);
    for (found, truth) in found.iter().zip(&poses).take(44) {
        assert!(
            matches!(found.status, Status::Found | Status::Tracked),
            "{found:?}"
        );
        assert_near(found.fix, truth);
    }
    for (found, truth) in found.iter().zip(&poses) {
        let away_m = -truth.translation.x - 15.0;
        assert!(away_m < 0.5 || found.fix.is_none(), "{found:?} at {truth}");
        assert!(
            away_m < 31.0 || found.status == Status::Lost,
            "{found:?} at {truth}"
        );
    }
}

#[test]
fn a_vehicle_that_was_carried_away_finds_itself_again() {
    let street = street();
    let mut localiser = localiser(&street);
    let before = (0..10).map(|k| pose(30.0 + 2.0 * f64::from(k), 0.0, 0.0));
    let carried: Vec<Pose> = (0..25)
        .map(|k| pose(200.0 + 2.0 * f64::from(k), 0.0, 0.5))
        .collect();
    drive(&mut localiser, &street, &before.collect::<Vec<_>>());
    let found = drive(&mut localiser, &street, &carried);
    assert!(
        found
            .iter()
            .any(|found| found.status == Status::Lost || found.status == Status::Found)
    );
    let last = found.len() - 1;
    assert_eq!(found[last].status, Status::Tracked);
    assert_near(found[last].fix, &carried[last]);
}

#[test]
fn a_scan_of_which_half_is_hidden_is_found() {
    let street = street();
    let mut localiser = localiser(&street);
    for (x, y, heading) in [(60.0, 1.0, 0.3), (150.3, 3.0, PI), (222.0, -1.0, -2.0)] {
        let at = pose(x, y, heading);
        let mut points = seen(&street, &at);
        points.retain(|point| point.y_m < 0.0);
        assert_near(localiser.find(&points, &Twist::default()), &at);
    }
}

#[test]
fn a_saved_map_finds_the_same_places() {
    let (street, folder) = (street(), tempfile::tempdir().unwrap());
    let saved = map(&street);
    // A shorter one before it leaves nothing behind.
    Map::new(saved.keyframes()[..9].to_vec())
        .unwrap()
        .save(folder.path())
        .unwrap();
    saved.save(folder.path()).unwrap();
    let opened = Map::open(folder.path()).unwrap();
    assert_eq!(opened.keyframes(), saved.keyframes());
    let points = seen(&street, &pose(99.0, 0.5, 1.0));
    let found = [saved, opened].map(|map| {
        let localiser = Localiser::new(map, &RefinementConfig::default(), CAPACITY);
        localiser.unwrap().find(&points, &Twist::default())
    });
    assert!(found[0].is_some());
    assert_eq!(found[0], found[1]);
}

#[test]
fn a_map_that_was_not_written_to_its_end_is_refused_with_what_to_do() {
    let (street, folder) = (street(), tempfile::tempdir().unwrap());
    let whole = map(&street);
    whole.save(folder.path()).unwrap();
    let mut log = RecordLog::<Keyframe>::open_file(&folder.path().join("keyframes.log")).unwrap();
    log.cut(100).unwrap();
    drop(log);
    let words = "keyframes.log has 100 keyframes and no end, and places.index 151: draw the map \
        again with gyre map";
    assert_refused(Map::open(folder.path()), words);
    assert_refused(Map::new(Vec::new()), "a map needs keyframes: there is none");
    assert_refused(Map::open(&folder.path().join("nowhere")), "places.index");
}
