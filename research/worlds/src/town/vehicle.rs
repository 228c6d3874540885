//! Cars.

use gyre_geometry::Pose;
use nalgebra::{Point2, Rotation2, Vector2};
use rand::Rng;

use super::random::{normal, random_positions, spread};
use super::site::{ParkedCar, Site};
use crate::body::{Aspect, Body, Scatterer, Wall};

/// Half of a car's length and width, metres.
pub(super) const CAR_HALF_M: (f64, f64) = (2.15, 0.9);
/// Two-way share of the power that passes a car: through its windows, below it, and above it to
/// what is higher.
const CAR_TRANSMISSION: f64 = 0.8;

/// A car around its own origin, x ahead: bright corners, wheels and plates, and sides that hide
/// what is behind.
///
/// The sum is about 10 m² on each side, the order reported for passenger cars at 77 GHz.
pub(crate) fn car(body: u32, rng: &mut impl Rng) -> Body {
    let (length, width) = CAR_HALF_M;
    let corners = [
        (length, width),
        (length, -width),
        (-length, -width),
        (-length, width),
    ]
    .map(|(x, y)| Point2::new(x, y));
    let mut car = Body::default();
    for side in 0..4 {
        let (from, to) = (corners[side], corners[(side + 1) % 4]);
        let corner = spread(rng, 2.0, 4.0);
        car.scatterers
            .push(Scatterer::all_round(from, corner, body));
        let direction = to - from;
        let outward = Vector2::new(-direction.y, direction.x).normalize();
        for share in random_positions(rng, 1.0, 0.1, 0.4) {
            let normal = Rotation2::new(rng.random_range(-0.5..0.5)) * outward;
            let aspect = Aspect::Facing {
                normal,
                sharpness: rng.random_range(1.0..10.0),
            };
            let cross_section_m2 = spread(rng, 1.5, 5.0);
            car.scatterers.push(Scatterer {
                position: from + direction * share,
                cross_section_m2,
                aspect,
                body,
            });
        }
    }
    // The diagonals stand for the outline: a line through the car crosses at least one of them.
    let diagonal =
        |from: Point2<f64>, to: Point2<f64>| Wall::rough(from, to, CAR_TRANSMISSION.sqrt(), body);
    car.walls = vec![
        diagonal(corners[0], corners[2]),
        diagonal(corners[1], corners[3]),
    ];
    car
}

impl ParkedCar {
    /// Returns its length and width, m.
    pub fn size_m(&self) -> [f64; 2] {
        [2.0 * CAR_HALF_M.0, 2.0 * CAR_HALF_M.1]
    }
}

impl Site<'_> {
    /// Adds a parked car at `place`, facing `heading_rad` or the opposite direction.
    pub(super) fn parked_car(&mut self, place: Point2<f64>, heading_rad: f64) {
        let number = self.body();
        let body = car(number, &mut self.rng);
        let askew_rad = (0.03 * normal(&mut self.rng)).clamp(-0.06, 0.06);
        let pose = Pose::new(place.coords, heading_rad + askew_rad);
        self.place(&body, &pose);
        self.built.parked.push(ParkedCar {
            pose: self.pose * pose,
            number,
            body,
        });
    }
}
