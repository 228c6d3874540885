//! Cars: parked ones, and those that come towards the vehicle on the other lane, with their true
//! poses in `objects.csv`.

use std::fmt::Write;

use gyre_geometry::{Pose, xy_yaw};
use nalgebra::{Point2, Rotation2, Vector2};
use rand::Rng;

use crate::body::{Body, Moving, Scatterer, Wall};
use crate::profile::Receiver;
use crate::route::{KERBS_M, Route};
use crate::simulator::Simulator;
use crate::stream::Stream;
use crate::world::World;

pub(crate) const FILE: &str = "objects.csv";
/// The first row of the file. Poses and velocities are in the world of `ground_truth.tum`.
const HEADER: &str =
    "scan,stamp_ns,object,kind,x_m,y_m,yaw_rad,vx_m_s,vy_m_s,length_m,width_m,visible,counts";
/// Half of a car's length and width, metres.
const HALF_M: [f64; 2] = [2.15, 0.9];
/// Two-way share of the power that passes each diagonal of a car, which stands for its outline: a
/// line through a car crosses at least one.
const TRANSMISSION: f64 = 0.9;
const FIRST_BODY: u32 = 1 << 24;
/// Speed of the oncoming cars, metres a second, and the distance between two, metres.
const SPEED_MPS: f64 = 8.0;
const APART_M: std::ops::Range<f64> = 50.0..120.0;
/// Distance within which cars are reported, metres: a third more than where radars of this kind
/// resolve a car.
const REPORTED_M: f64 = 100.0;

/// A car around its own origin, x ahead: bright corners, wheels and plates, and sides that hide the
/// space behind. The sum is about 10 m² on each side, the order reported for passenger cars at 77
/// GHz.
pub(crate) fn car(body: u32, rng: &mut impl Rng) -> Body {
    let [length, width] = HALF_M;
    let corners = [
        (length, width),
        (length, -width),
        (-length, -width),
        (-length, width),
    ]
    .map(|(x, y)| Point2::new(x, y));
    let mut car = Body::default();
    let spread = |rng: &mut _, median: f64, factor: f64| {
        median * factor.powf(Rng::random_range(rng, -1.0..1.0))
    };
    for side in 0..4 {
        let (from, to) = (corners[side], corners[(side + 1) % 4]);
        let corner = spread(rng, 2.0, 4.0);
        car.scatterers
            .push(Scatterer::all_round(from, corner, body));
        let direction = to - from;
        let outward = Vector2::new(-direction.y, direction.x).normalize();
        for share in [0.15, 0.4, 0.65, 0.9] {
            let normal = Rotation2::new(rng.random_range(-0.5..0.5)) * outward;
            let sharpness = rng.random_range(1.0..10.0);
            let position = from + direction * (share + rng.random_range(-0.1..0.1));
            let cross_section_m2 = spread(rng, 1.5, 5.0);
            let part = Scatterer::facing(position, cross_section_m2, normal, sharpness, body);
            car.scatterers.push(part);
        }
    }
    let diagonals = [[0, 2], [1, 3]].map(|ends| ends.map(|end| corners[end]));
    car.walls = diagonals
        .map(|[from, to]| Wall::new(from, to, TRANSMISSION, body))
        .to_vec();
    car
}

#[derive(Clone, Debug)]
pub(crate) struct Cars {
    route: Route,
    bodies: Vec<Body>,
    /// Place of each along the route at the start of the drive, metres.
    starts_m: Vec<f64>,
}

impl Cars {
    /// Cars that meet the vehicle until a time, s.
    pub fn new(route: &Route, until_s: f64, seed: u64) -> Self {
        let mut rng = Stream::CARS.generator(seed);
        let mut cars = Self {
            route: route.clone(),
            bodies: Vec::new(),
            starts_m: Vec::new(),
        };
        let end_m = match route.closed {
            true => route.length_m() - APART_M.start,
            false => route.length_m() + SPEED_MPS * until_s,
        };
        let mut at_m = rng.random_range(0.0..APART_M.start);
        while at_m < end_m {
            cars.bodies
                .push(car(FIRST_BODY + cars.bodies.len() as u32, &mut rng));
            cars.starts_m.push(at_m);
            at_m += rng.random_range(APART_M);
        }
        cars
    }

    pub fn near(&self, place: Point2<f64>, reach_m: f64, time_s: f64) -> Vec<Moving<'_>> {
        let at = |(body, start_m)| self.at(body, start_m, time_s);
        let all = self.bodies.iter().zip(&self.starts_m).filter_map(at);
        all.filter(|car| (car.pose.translation.vector - place.coords).norm() < reach_m)
            .collect()
    }

    fn at<'a>(&self, body: &'a Body, start_m: &f64, time_s: f64) -> Option<Moving<'a>> {
        let lane = Pose::new(
            Vector2::new(0.0, KERBS_M[0] - KERBS_M[1]),
            std::f64::consts::PI,
        );
        let pose = |at_s: f64| Some(self.route.at(start_m - SPEED_MPS * at_s)? * lane);
        let (here, before, after) = (pose(time_s)?, pose(time_s - 0.1)?, pose(time_s + 0.1)?);
        Some(Moving {
            body,
            pose: here,
            velocity: (after.translation.vector - before.translation.vector) / 0.2,
        })
    }
}

/// `objects.csv` as bytes: the moving cars within 100 m at the time of each scan.
pub(crate) fn objects_csv(simulator: &Simulator, stamps_ns: &[i64]) -> String {
    let mut text = format!("{HEADER}\n");
    let receiver = simulator.config().sensor.receiver();
    for (scan, &stamp_ns) in stamps_ns.iter().enumerate() {
        let time_s = simulator.drive_time_s(stamp_ns);
        let place = Point2::from(simulator.path().pose(time_s).translation.vector);
        for car in simulator.cars.near(place, REPORTED_M, time_s) {
            let [visible, power] = best_echo(simulator.world(), &receiver, place, &car);
            let object = car.body.walls[0].body - FIRST_BODY;
            let ([x, y, yaw], [length, width]) = (xy_yaw(&car.pose), HALF_M);
            let [vx, vy]: [f64; 2] = car.velocity.into();
            // Writing to memory cannot fail.
            let _ = writeln!(
                text,
                "{scan},{stamp_ns},{object},car,{x:.4},{y:.4},{yaw:.6},{vx:.4},{vy:.4},{:.2},{:.2},{visible:.4},{:.1}",
                2.0 * length,
                2.0 * width,
                20.0 * power.max(1.0).log10()
            );
        }
    }
    text
}

/// The largest share of the power that passes to a part of a car, and the power of its strongest
/// echo, without scintillation and speckle.
fn best_echo(world: &World, receiver: &Receiver, from: Point2<f64>, car: &Moving<'_>) -> [f64; 2] {
    let parts = car.body.scatterers.iter().map(|part| {
        let there = part.moved(&car.pose);
        let ray = from - there.position;
        let range_m = ray.norm().max(1.0);
        let passed = world.transmission(from, there.position, there.body);
        let gain = there.gain(ray / range_m);
        let power = there.cross_section_m2 * gain * receiver.sensitivity(range_m);
        [passed, power * passed]
    });
    parts.fold([0.0; 2], |best: [f64; 2], part| {
        [best[0].max(part[0]), best[1].max(part[1])]
    })
}
