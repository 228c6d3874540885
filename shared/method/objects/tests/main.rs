//! Tracking in written scenes: returns of walls and vehicles as a radar measures them, each at the
//! time of its azimuth and moved by the Doppler shift.

#![allow(clippy::unwrap_used)]

use std::f64::consts::{PI, TAU};

use gyre_geometry::{Pose, SparsePoint, Twist, pose};
use gyre_objects::{Object, ObjectTracker, ObjectsConfig, PlacedScan};
use nalgebra::{Point2, Rotation2, Vector2};

const PERIOD_S: f64 = 0.25;
const DOPPLER_S: f64 = 0.046;

/// Returns of a car relative to its centre, along its heading and across it, m.
const OUTLINE: [(f64, f64); 14] = [
    (2.2, -0.9),
    (2.2, 0.0),
    (2.2, 0.9),
    (1.1, -0.9),
    (1.1, 0.9),
    (0.0, -0.9),
    (0.0, 0.9),
    (-1.1, -0.9),
    (-1.1, 0.9),
    (-2.2, -0.9),
    (-2.2, 0.0),
    (-2.2, 0.9),
    (0.5, 0.0),
    (-0.5, 0.0),
];

/// Returns of a bus of which only the ends are seen, between which nothing is.
const BUS: [(f64, f64); 6] = [
    (5.8, -1.2),
    (5.8, 0.0),
    (5.8, 1.2),
    (-5.8, -1.2),
    (-5.8, 0.0),
    (-5.8, 1.2),
];

/// A car by its returns.
#[derive(Clone, Copy)]
struct Car {
    /// Centre and velocity at time zero.
    at: Point2<f64>,
    velocity: Vector2<f64>,
    turn_radps: f64,
    outline: &'static [(f64, f64)],
}

impl Car {
    fn new(at: Point2<f64>, velocity: Vector2<f64>) -> Self {
        Self {
            at,
            velocity,
            turn_radps: 0.0,
            outline: &OUTLINE,
        }
    }

    /// Returns its centre and velocity at a time.
    fn after(&self, time_s: f64) -> (Point2<f64>, Vector2<f64>) {
        let turned = self.turn_radps * time_s;
        let velocity = Rotation2::new(turned) * self.velocity;
        // The chord of an arc.
        let chord = match turned.abs() < 1e-9 {
            true => time_s,
            false => (0.5 * turned).sin() / (0.5 * self.turn_radps),
        };
        (
            self.at + Rotation2::new(0.5 * turned) * self.velocity * chord,
            velocity,
        )
    }
}

/// A vehicle that drives ahead at 8 m/s between two walls, and what is around it.
struct Scene {
    sensor_mps: f64,
    tracker: ObjectTracker,
    scan: u32,
    /// True without the wall on the left.
    is_open: bool,
}

impl Scene {
    fn new() -> Self {
        Self {
            sensor_mps: 8.0,
            tracker: ObjectTracker::new(&ObjectsConfig::default()).unwrap(),
            scan: 0,
            is_open: false,
        }
    }

    fn time_s(&self) -> f64 {
        f64::from(self.scan) * PERIOD_S
    }

    /// Steps so many times with these cars, and returns the last objects.
    fn steps(&mut self, count: usize, cars: &[Car]) -> Vec<Object> {
        (1..count).for_each(|_| _ = self.step(cars));
        self.step(cars)
    }

    /// Measures the walls and these cars, and tracks.
    fn step(&mut self, cars: &[Car]) -> Vec<Object> {
        let mut points = Vec::new();
        for post in 0..150 {
            let x = -99.8 + 2.0 * f64::from(post);
            for y in [-15.2, 15.2] {
                if y < 0.0 || !self.is_open {
                    let still = Vector2::zeros();
                    (0..4).for_each(|k| {
                        points.push((Point2::new(x + 0.5 * f64::from(k), y), still));
                    });
                }
            }
        }
        for car in cars {
            let (centre, velocity) = car.after(self.time_s());
            let heading = velocity.try_normalize(1e-9).unwrap_or_else(Vector2::x);
            let side = Vector2::new(-heading.y, heading.x);
            for (a, b) in car.outline {
                points.push((centre + heading * *a + side * *b, velocity));
            }
        }
        let placed = PlacedScan {
            stamp_ns: (self.time_s() * 1e9) as i64,
            pose: self.sensor(0.0),
            twist: Twist {
                vx_mps: self.sensor_mps,
                ..Twist::default()
            },
        };
        let points: Vec<SparsePoint> = points
            .iter()
            .filter_map(|(at, velocity)| self.measured(at, velocity))
            .collect();
        self.scan += 1;
        self.tracker.update(&placed, &points).to_vec()
    }

    fn sensor(&self, after_s: f64) -> Pose {
        pose(self.sensor_mps * (self.time_s() + after_s), 0.0, 0.0)
    }

    /// A return of what is `at` a place at the scan's time, seen when the beam passes it.
    fn measured(&self, at: &Point2<f64>, velocity: &Vector2<f64>) -> Option<SparsePoint> {
        let mut time_s = 0.0;
        let mut seen = Point2::origin();
        for _ in 0..5 {
            seen = self.sensor(time_s).inverse() * (at + velocity * time_s);
            let clockwise = (-seen.y.atan2(seen.x)).rem_euclid(TAU);
            time_s = (clockwise / TAU - 0.5) * PERIOD_S;
        }
        let range_m = seen.coords.norm();
        let closing = -(velocity - Vector2::new(self.sensor_mps, 0.0)).dot(&seen.coords) / range_m;
        let shown = seen.coords * (1.0 - DOPPLER_S * closing / range_m);
        (5.0..80.0).contains(&range_m).then(|| {
            SparsePoint::from([
                shown.x as f32,
                shown.y as f32,
                time_s as f32,
                1.0,
                DOPPLER_S as f32,
            ])
        })
    }
}

/// Scans of walls alone, as at the start of a drive.
fn settled() -> Scene {
    let mut scene = Scene::new();
    for _ in 0..12 {
        assert_eq!(scene.step(&[]), []);
    }
    scene
}

#[test]
fn what_stands_is_no_object_from_a_vehicle_that_moves() {
    let mut scene = settled();
    let parked = Car::new(Point2::new(60.0, 5.0), Vector2::zeros());
    for _ in 0..40 {
        assert!(scene.step(&[parked]).iter().all(|object| !object.moving));
    }
}

#[test]
fn an_oncoming_car_is_tracked_from_its_third_scan_without_bias_of_time_and_doppler() {
    let mut scene = settled();
    // Straight ahead, where the sweep begins and ends: its two sides are seen a quarter of a second
    // apart.
    let car = Car::new(Point2::new(140.0, 0.5), Vector2::new(-12.0, 0.0));
    let mut seen = 0;
    let mut last = None;
    for _ in 0..14 {
        let centre = car.at + car.velocity * scene.time_s();
        let ahead_m = centre.x - scene.sensor(0.0).translation.x;
        let objects = scene.step(&[car]);
        seen += i32::from(ahead_m < 65.0);
        if seen > 3 {
            assert_eq!(objects.len(), 1, "{ahead_m} m");
            let object = objects[0];
            assert!(object.moving && last.is_none_or(|id| id == object.id));
            last = Some(object.id);
        }
        if seen > 6 {
            let object = objects[0];
            assert!((object.velocity - car.velocity).norm() < 0.8, "{object:?}");
            assert!(
                (object.position - centre).norm() < 1.0,
                "{object:?} at {centre}"
            );
            assert!((object.yaw_rad.abs() - PI).abs() < 0.1, "{object:?}");
        }
    }
    assert!(seen > 6, "{seen}");
}

#[test]
fn a_car_that_turns_off_keeps_its_identity_and_its_velocity_follows() {
    let mut scene = settled();
    scene.is_open = true;
    let car = Car::new(Point2::new(20.0, -4.0), Vector2::new(7.0, 0.0));
    let first = scene.steps(8, &[car]);
    assert_eq!(first.len(), 1, "{first:?}");
    let (at, velocity) = car.after(scene.time_s());
    let turning = Car {
        turn_radps: 0.6,
        ..Car::new(at, velocity)
    };
    let start_s = scene.time_s();
    for _ in 0..10 {
        let after_s = scene.time_s() - start_s;
        let (centre, velocity) = turning.after(after_s);
        // At its place by the time since the turn began.
        let now = Car {
            at: centre - velocity * scene.time_s(),
            turn_radps: 0.0,
            ..Car::new(centre, velocity)
        };
        let objects = scene.step(&[now]);
        assert_eq!(objects.len(), 1, "{objects:?} after {after_s} s");
        let object = objects[0];
        assert_eq!(object.id, first[0].id);
        assert!(
            (object.velocity - velocity).norm() < 2.5,
            "{object:?}, {velocity}"
        );
        assert!(
            (object.position - centre).norm() < 1.2,
            "{object:?} at {centre}"
        );
    }
}

#[test]
fn the_two_ends_of_a_bus_are_one_object() {
    let mut scene = settled();
    let bus = Car {
        outline: &BUS,
        ..Car::new(Point2::new(140.0, 4.0), Vector2::new(-9.0, 0.0))
    };
    let mut alone = 0;
    for _ in 0..19 {
        let (centre, _) = bus.after(scene.time_s());
        let objects = scene.step(&[bus]);
        let is_one = objects.len() == 1 && (objects[0].position - centre).norm() < 1.5;
        alone = if is_one { alone + 1 } else { 0 };
    }
    assert!(alone > 3, "{alone}");
}

#[test]
fn two_cars_in_a_queue_stay_two() {
    let mut scene = settled();
    let behind = |gap_m: f64| Car::new(Point2::new(110.0 + gap_m, 4.0), Vector2::new(-9.0, 0.0));
    let objects = scene.steps(12, &[behind(0.0), behind(7.0)]);
    assert_eq!(objects.len(), 2, "{objects:?}");
    let apart = objects[0].position - objects[1].position;
    assert!((apart.norm() - 7.0).abs() < 1.0, "{objects:?}");
}

#[test]
fn a_hidden_car_keeps_its_identity_and_ends_when_it_stays_hidden() {
    let mut scene = settled();
    let car = Car::new(Point2::new(15.0, 4.0), Vector2::new(10.0, 0.0));
    let before = scene.steps(8, &[car]);
    assert_eq!(before.len(), 1);
    // It is reported until it has probably gone.
    assert_eq!(scene.step(&[])[0].id, before[0].id);
    assert_eq!(scene.steps(2, &[]), []);
    assert_eq!(scene.step(&[car])[0].id, before[0].id);
    let after = scene.steps(6, &[]);
    assert_eq!(after, []);
}

#[test]
fn an_image_behind_a_wall_is_not_born_and_the_same_in_the_open_is() {
    let tracked = |is_open: bool| {
        let mut scene = Scene {
            is_open,
            ..Scene::new()
        };
        let image = Car::new(Point2::new(-10.0, 24.0), Vector2::new(9.0, 0.0));
        (0..20).for_each(|scan| {
            scene.step(if scan < 10 {
                &[]
            } else {
                std::slice::from_ref(&image)
            });
        });
        scene.step(&[image]).len()
    };
    assert_eq!((tracked(false), tracked(true)), (0, 1));
}

#[test]
fn a_gap_in_time_ends_all_tracks_and_identities_are_not_given_again() {
    let mut scene = settled();
    let car = Car::new(Point2::new(15.0, 4.0), Vector2::new(10.0, 0.0));
    let first = scene.steps(8, &[car])[0].id;
    scene.scan += 40;
    assert_eq!(scene.step(&[car]), []);
    let at = car.at - Vector2::new(1.0, 0.0) * 2.0 * scene.time_s();
    let car = Car::new(at, Vector2::new(12.0, 0.0));
    scene.steps(5, &[]);
    let again = scene.steps(8, &[car]);
    assert_eq!(again.len(), 1);
    assert!(again[0].id > first, "{again:?}");
}
