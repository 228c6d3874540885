//! The changes between two drives along a street whose content is known.

use gyre_changes::{Change, ChangeKind, Changes, Survey, changes};
use gyre_geometry::{Pose, SparsePoint, Twist, UncertainMotion, pose};
use gyre_slam::Keyframe;
use nalgebra::{Point2, Vector2};

/// A wall 20 m to the left of the x axis, a point every 0.1 m.
fn wall() -> Vec<Point2<f64>> {
    (-300..300)
        .map(|k| Point2::new(f64::from(k) * 0.1, 20.0))
        .collect()
}

/// The keyframe at `pose` that sees `places` of the map frame, standing.
fn keyframe(seq: u64, pose: &Pose, places: &[Point2<f64>]) -> Keyframe {
    let points = places.iter().map(|place| {
        let seen = pose.inverse() * place;
        SparsePoint::from([seen.x as f32, seen.y as f32, 0.0, 1.0, 0.0])
    });
    Keyframe {
        seq,
        scan: seq,
        stamp_ns: seq as i64 * 250_000_000,
        pose: UncertainMotion {
            motion: *pose,
            ..UncertainMotion::identity()
        },
        motion: UncertainMotion::identity(),
        noise: nalgebra::Matrix3::zeros(),
        twist: Twist::default(),
        path_m: 0.0,
        points: points.collect(),
    }
}

/// Returns of a car along the x axis: its corners.
fn car(x_m: f64, y_m: f64) -> Vec<Point2<f64>> {
    let corners = [[-2.1, -0.9], [-2.1, 0.9], [2.1, -0.9], [2.1, 0.9]];
    corners.map(|[x, y]| Point2::new(x_m + x, y_m + y)).to_vec()
}

/// Random numbers from 0 to 1.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        // Knuth's linear congruential generator.
        let Self(state) = self;
        *state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (*state >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// A drive along the x axis that sees a wall beyond `things`, and bushes in between of which each
/// look shows others.
fn survey(things: &[Vec<Point2<f64>>], seed: u64) -> Survey {
    let mut survey = Survey::default();
    let mut random = Random(seed);
    for seq in 0..40 {
        let at = pose(-40.0 + 2.0 * seq as f64, 0.0, 0.0);
        // What returns comes and goes.
        let mut places = [wall(), things.concat()].concat();
        places.retain(|_| random.next() < 0.7);
        for bush in -14..14 {
            let bush = Point2::new(2.0 * f64::from(bush), 15.0);
            if random.next() < 0.4 {
                let by = Vector2::new(random.next(), random.next());
                places.push(bush + by);
            }
        }
        survey.add(&keyframe(seq, &at, &places), &at);
    }
    survey
}

fn found(before: &[Vec<Point2<f64>>], after: &[Vec<Point2<f64>>]) -> Changes {
    changes(&survey(before, 1), &survey(after, 2)).unwrap()
}

fn is_car(change: &Change, kind: ChangeKind, x_m: f64, y_m: f64) -> bool {
    change.kind == kind
        && (change.x_m - x_m).hypot(change.y_m - y_m) < 0.7
        && (4.0..6.5).contains(&change.length_m)
        && (1.5..3.5).contains(&change.width_m)
        && change.yaw_rad.abs() < 0.2
}

#[test]
fn a_car_that_has_come_and_one_that_has_gone_are_found() {
    let (stays, goes, comes) = (car(-10.0, 8.0), car(0.0, 8.0), car(10.0, 8.0));
    let Changes { changes, .. } = found(&[stays.clone(), goes], &[stays, comes]);
    assert_eq!(changes.len(), 2, "{changes:?}");
    let has = |kind, x_m| changes.iter().any(|it| is_car(it, kind, x_m, 8.0));
    assert!(
        has(ChangeKind::Gone, 0.0) && has(ChangeKind::Appeared, 10.0),
        "{changes:?}"
    );
    assert!(changes.iter().all(|it| it.confidence > 0.8), "{changes:?}");
}

#[test]
fn a_street_that_stays_has_no_changes_and_neither_have_its_bushes() {
    let stays = [car(0.0, 8.0)];
    let found = found(&stays, &stays);
    assert_eq!(found.changes, []);
    assert!(found.compared_m2 > 500.0, "{}", found.compared_m2);
}

#[test]
fn what_one_drive_did_not_look_at_has_not_changed() {
    // On the other side nothing returns beyond the car, so that without it nothing is looked at.
    assert_eq!(found(&[], &[car(0.0, -8.0)]).changes, []);
    // Behind the wall.
    assert_eq!(found(&[], &[car(0.0, 26.0)]).changes, []);
}

#[test]
fn what_is_smaller_than_a_car_is_not_reported() {
    let post = vec![Point2::new(0.0, 8.0)];
    assert_eq!(found(&[], &[post]).changes, []);
}
