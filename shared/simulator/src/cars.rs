//! Cars: parked ones, and those that come towards the vehicle on the other lane.

use gyre_geometry::Pose;
use nalgebra::{Point2, Rotation2, Vector2};
use rand::Rng;

use crate::body::{Body, Moving, Scatterer, Wall};
use crate::route::{KERBS_M, Route};
use crate::stream::Stream;

/// Half of a car's length and width, metres.
pub(crate) const HALF_M: [f64; 2] = [2.15, 0.9];
/// Two-way share of the power that passes each diagonal of a car, which stands for its outline: a
/// line through a car crosses at least one.
const TRANSMISSION: f64 = 0.9;
pub(crate) const FIRST_BODY: u32 = 1 << 24;
/// Speed of the oncoming cars, metres a second, and the distance between two, metres.
const SPEED_MPS: f64 = 8.0;
const APART_M: std::ops::Range<f64> = 50.0..120.0;

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
