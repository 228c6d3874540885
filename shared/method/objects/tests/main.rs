//! Tracking in written scenes: returns of walls and vehicles as a radar measures them, each at the
//! time of its azimuth and moved by the Doppler shift. They come and go from scan to scan.

#![allow(clippy::unwrap_used)]

use std::f64::consts::{PI, TAU};

use gyre_contract::Object;
use gyre_geometry::{Pose, SparsePoint, pose};
use gyre_objects::{ObjectTracker, PlacedScan};
use nalgebra::{Point2, Rotation2, Vector2};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const PERIOD_S: f64 = 0.25;
const DOPPLER_S: f64 = 0.046;
const HALF_M: (f64, f64) = (2.2, 0.9);
const RETURNS: usize = 25;

#[derive(Clone, Copy)]
struct Car {
    at: Point2<f64>,
    velocity: Vector2<f64>,
    from_s: f64,
    turn_radps: f64,
}

impl Car {
    fn at(&self, time_s: f64) -> (Point2<f64>, Vector2<f64>) {
        let time_s = time_s - self.from_s;
        let turned = self.turn_radps * time_s;
        let velocity = Rotation2::new(turned) * self.velocity;
        // The chord of an arc.
        let chord = match turned.abs() < 1e-9 {
            true => time_s,
            false => (0.5 * turned).sin() / (0.5 * self.turn_radps),
        };
        let centre = self.at + Rotation2::new(0.5 * turned) * self.velocity * chord;
        (centre, velocity)
    }
}

/// A vehicle that drives ahead at 8 m/s between two walls, and the objects around it.
struct Scene {
    sensor_mps: f64,
    tracker: ObjectTracker,
    random: ChaCha8Rng,
    scan: u32,
}

impl Scene {
    /// Scans of walls alone, as at the start of a drive.
    fn settled() -> Self {
        let mut scene = Self {
            sensor_mps: 8.0,
            tracker: ObjectTracker::new(None).unwrap(),
            random: ChaCha8Rng::seed_from_u64(5),
            scan: 0,
        };
        for _ in 0..20 {
            assert_eq!(scene.step(&[]), []);
        }
        scene
    }

    fn time_s(&self) -> f64 {
        f64::from(self.scan) * PERIOD_S
    }

    /// Returns a car that is so far from the sensor now, and drives straight.
    fn car(&self, x_m: f64, y_m: f64, velocity: [f64; 2]) -> Car {
        Car {
            at: self.sensor(0.0) * Point2::new(x_m, y_m),
            velocity: velocity.into(),
            from_s: self.time_s(),
            turn_radps: 0.0,
        }
    }

    /// Steps so many times with these cars, and returns the last objects.
    fn steps(&mut self, count: usize, cars: &[Car]) -> Vec<Object> {
        (1..count).for_each(|_| _ = self.step(cars));
        self.step(cars)
    }

    fn step(&mut self, cars: &[Car]) -> Vec<Object> {
        let mut points = Vec::new();
        for post in 0..800 {
            let at = Point2::new(-99.8 + 0.5 * f64::from(post), 0.0);
            for y in [-15.2, 15.2] {
                if self.random.random_bool(0.6) {
                    points.push((at + Vector2::new(0.0, y), Vector2::zeros()));
                }
            }
        }
        for car in cars {
            let (centre, velocity) = car.at(self.time_s());
            let heading = velocity.try_normalize(1e-9).unwrap_or_else(Vector2::x);
            let side = Vector2::new(-heading.y, heading.x);
            for _ in 0..RETURNS {
                let [a, b] = [HALF_M.0, HALF_M.1].map(|half| self.random.random_range(-half..half));
                points.push((centre + heading * a + side * b, velocity));
            }
        }
        let placed = PlacedScan {
            stamp_ns: (self.time_s() * 1e9) as i64,
            pose: self.sensor(0.0),
            twist: [self.sensor_mps, 0.0, 0.0].into(),
        };
        let points: Vec<SparsePoint> = points
            .iter()
            .filter_map(|(at, velocity)| self.measured(at, velocity))
            .collect();
        self.scan += 1;
        self.tracker.update(&placed, &points).unwrap().to_vec()
    }

    fn sensor(&self, after_s: f64) -> Pose {
        pose(self.sensor_mps * (self.time_s() + after_s), 0.0, 0.0)
    }

    /// A return of an object that is `at` a place at the scan's time, measured when the beam passes
    /// it.
    fn measured(&mut self, at: &Point2<f64>, velocity: &Vector2<f64>) -> Option<SparsePoint> {
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
        let weight = self.random.random_range(0.2..0.9);
        (5.0..80.0).contains(&range_m).then(|| {
            SparsePoint::from([
                shown.x as f32,
                shown.y as f32,
                time_s as f32,
                weight,
                DOPPLER_S as f32,
            ])
        })
    }
}

fn place_of(object: &Object) -> Point2<f64> {
    Point2::new(object.x_m, object.y_m)
}

fn velocity_of(object: &Object) -> Vector2<f64> {
    Vector2::new(object.vx_mps, object.vy_mps)
}

#[test]
fn what_stands_is_no_object_from_a_vehicle_that_moves() {
    let mut scene = Scene::settled();
    let parked = scene.car(60.0, 5.0, [0.0, 0.0]);
    for _ in 0..40 {
        assert_eq!(scene.step(&[parked]), []);
    }
}

#[test]
fn an_oncoming_car_is_tracked_from_its_fourth_scan_without_bias_of_time_and_doppler() {
    let mut scene = Scene::settled();
    let car = scene.car(75.0, 3.5, [-7.0, 0.0]);
    let mut seen = 0;
    let mut last = None;
    for _ in 0..16 {
        let (centre, velocity) = car.at(scene.time_s());
        let ahead_m = centre.x - scene.sensor(0.0).translation.x;
        let objects = scene.step(&[car]);
        seen += i32::from(ahead_m < 62.0);
        if seen > 3 {
            assert_eq!(objects.len(), 1, "{ahead_m} m");
            let object = objects[0];
            assert!(object.is_moving() && last.is_none_or(|id| id == object.id));
            last = Some(object.id);
            assert!((velocity_of(&object) - velocity).norm() < 1.5, "{object:?}");
            let off_m = (place_of(&object) - centre).norm();
            assert!(off_m < 1.0, "{object:?} at {centre}");
            assert!((object.yaw_rad.abs() - PI).abs() < 0.2, "{object:?}");
        }
    }
    assert!(seen > 8, "{seen}");
}

#[test]
fn a_car_that_turns_off_keeps_its_identity_and_its_velocity_follows() {
    let mut scene = Scene::settled();
    let car = scene.car(20.0, -4.0, [7.0, 0.0]);
    let first = scene.steps(8, &[car]);
    assert_eq!(first.len(), 1, "{first:?}");
    let (at, velocity) = car.at(scene.time_s());
    let turning = Car {
        at,
        velocity,
        from_s: scene.time_s(),
        turn_radps: 0.4,
    };
    for _ in 0..6 {
        let (centre, velocity) = turning.at(scene.time_s());
        let objects = scene.step(&[turning]);
        assert_eq!(objects.len(), 1, "{objects:?}");
        let object = objects[0];
        assert_eq!(object.id, first[0].id);
        let off_mps = (velocity_of(&object) - velocity).norm();
        assert!(off_mps < 3.0, "{object:?}, {velocity}");
        let off_m = (place_of(&object) - centre).norm();
        assert!(off_m < 1.2, "{object:?} at {centre}");
    }
}

#[test]
fn two_cars_in_a_queue_stay_two() {
    let mut scene = Scene::settled();
    let behind = |gap_m: f64| scene.car(50.0 + gap_m, 4.0, [-7.0, 0.0]);
    let cars = [behind(0.0), behind(16.0)];
    let objects = scene.steps(10, &cars);
    assert_eq!(objects.len(), 2, "{objects:?}");
    let apart = place_of(&objects[0]) - place_of(&objects[1]);
    assert!((apart.norm() - 16.0).abs() < 1.0, "{objects:?}");
}

#[test]
fn a_hidden_car_keeps_its_identity_and_ends_when_it_stays_hidden() {
    let mut scene = Scene::settled();
    let car = scene.car(15.0, 4.0, [9.0, 0.0]);
    let before = scene.steps(8, &[car]);
    assert_eq!(before.len(), 1);
    scene.steps(2, &[]);
    let after = scene.steps(3, &[car]);
    assert_eq!(
        after.iter().map(|it| it.id).collect::<Vec<_>>(),
        [before[0].id]
    );
    assert_eq!(scene.steps(8, &[]), []);
}

#[test]
fn a_gap_in_time_ends_all_tracks_and_identities_are_not_given_again() {
    let mut scene = Scene::settled();
    let car = |scene: &Scene| scene.car(15.0, 4.0, [9.0, 0.0]);
    let first = car(&scene);
    let first = scene.steps(8, &[first])[0].id;
    scene.scan += 40;
    let again = car(&scene);
    assert_eq!(scene.step(&[again]), []);
    let again = scene.steps(8, &[again]);
    assert_eq!(again.len(), 1);
    assert!(again[0].id > first, "{again:?}");
}
