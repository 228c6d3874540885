//! What stands between the houses and the road: lamp posts, trees, parked cars.

use nalgebra::{Isometry2, Point2, Rotation2, Vector2};
use rand::Rng;

use super::random::{normal, spread, stations};
use super::{CLEARANCE_M, Edge, Planner};
use crate::world::{Aspect, Body, NO_BODY, Scatterer, Wall};

/// From the house fronts to the row of posts and trees, metres.
const POSTS_OUT_M: f64 = 2.2;
/// From the house fronts to the middle of parked cars, metres.
const CARS_OUT_M: f64 = 3.4;
/// Width of the strip between the house fronts and the road, metres.
const VERGE_M: f64 = 4.5;
/// Half a car's length and width, metres.
const CAR_HALF_M: (f64, f64) = (2.15, 0.9);
/// Power that passes a car (through its windows and below it), there and back.
const CAR_TRANSMISSION: f64 = 0.6;

impl Planner<'_> {
    /// Everything along one side of a street.
    pub(super) fn kerb(&mut self, edge: &Edge) {
        for along in stations(&mut self.rng, edge.length_m, 20.0, 32.0) {
            self.post(edge.at(along, POSTS_OUT_M));
        }
        if self.rng.random_bool(0.5) {
            for along in stations(&mut self.rng, edge.length_m, 6.0, 15.0) {
                self.tree(edge.at(along, POSTS_OUT_M - 0.3));
            }
        }
        for along in stations(&mut self.rng, edge.length_m, 5.0, 16.0) {
            self.parked_car(edge, along);
        }
        self.verge(edge);
    }

    /// Kerb stones, hedges, bins and roughness between the houses and the road: weak, and everywhere.
    fn verge(&mut self, edge: &Edge) {
        for along in stations(&mut self.rng, edge.length_m, 0.05, 0.3) {
            let place = edge.at(along, self.rng.random_range(0.0..VERGE_M));
            if self.is_free(place) {
                let cross_section_m2 = spread(&mut self.rng, 0.02, 6.0);
                self.add(Scatterer { position: place, cross_section_m2, aspect: Aspect::AllRound, body: NO_BODY });
            }
        }
    }

    fn is_free(&self, place: Point2<f64>) -> bool {
        self.streets.clearance_m(place, CLEARANCE_M) >= CLEARANCE_M
    }

    /// A lamp post: pole, foot and door, close together.
    fn post(&mut self, place: Point2<f64>) {
        if !self.is_free(place) {
            return;
        }
        for median in [3.0, 1.0, 0.5] {
            let cross_section_m2 = spread(&mut self.rng, median, 3.0);
            self.loose(place, 0.12, cross_section_m2);
        }
    }

    /// A tree: a trunk in a cloud of branches.
    fn tree(&mut self, place: Point2<f64>) {
        if !self.is_free(place) {
            return;
        }
        let trunk = spread(&mut self.rng, 1.5, 3.0);
        self.loose(place, 0.1, trunk);
        for _ in 0..18 {
            let branch = spread(&mut self.rng, 0.08, 4.0);
            self.loose(place, 0.9, branch);
        }
    }

    /// A scatterer that stands alone, about `deviation_m` from `place`.
    fn loose(&mut self, place: Point2<f64>, deviation_m: f64, cross_section_m2: f64) {
        // Normal numbers have no end; the road has to stay free.
        let mut offset = || (deviation_m * normal(&mut self.rng)).clamp(-1.5, 1.5);
        let position = place + Vector2::new(offset(), offset());
        self.add(Scatterer { position, cross_section_m2, aspect: Aspect::AllRound, body: NO_BODY });
    }

    fn parked_car(&mut self, edge: &Edge, along: f64) {
        let place = edge.at(along, CARS_OUT_M);
        if !self.is_free(place) {
            return;
        }
        let direction = edge.along.y.atan2(edge.along.x) + 0.03 * normal(&mut self.rng);
        let pose = Isometry2::new(place.coords, direction);
        let body = self.next_body();
        let car = car(body, &mut self.rng);
        self.content.scatterers.extend(car.scatterers.iter().map(|s| s.moved(&pose)));
        self.content.walls.extend(car.walls.iter().map(|w| w.moved(&pose)));
    }
}

/// A car around its own origin, x ahead: bright corners, wheels and plates, and sides that hide what is behind.
pub(crate) fn car(body: u32, rng: &mut impl Rng) -> Body {
    let (length, width) = CAR_HALF_M;
    let corners =
        [(length, width), (length, -width), (-length, -width), (-length, width)].map(|(x, y)| Point2::new(x, y));
    let mut car = Body::default();
    for side in 0..4 {
        let (from, to) = (corners[side], corners[(side + 1) % 4]);
        let corner = spread(rng, 2.0, 4.0);
        car.scatterers.push(Scatterer { position: from, cross_section_m2: corner, aspect: Aspect::AllRound, body });
        let way = to - from;
        let outward = Vector2::new(-way.y, way.x).normalize();
        for share in stations(rng, 1.0, 0.1, 0.4) {
            let normal = Rotation2::new(rng.random_range(-0.5..0.5)) * outward;
            let aspect = Aspect::Facing { normal, sharpness: rng.random_range(1.0..10.0) };
            let cross_section_m2 = spread(rng, 1.5, 5.0);
            car.scatterers.push(Scatterer { position: from + way * share, cross_section_m2, aspect, body });
        }
    }
    // Either diagonal stands for the whole outline: whatever passes the car crosses one at least.
    let diagonal = |from: Point2<f64>, to: Point2<f64>| Wall {
        from,
        to,
        transmission: CAR_TRANSMISSION.sqrt(),
        mirror: 0.0,
        body,
    };
    car.walls = vec![diagonal(corners[0], corners[2]), diagonal(corners[1], corners[3])];
    car
}
