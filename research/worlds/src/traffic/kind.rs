//! The bodies of cars, vans, lorries, buses, cyclists and pedestrians at 77 GHz.
//!
//! Cross-sections are of the published order: 1 to 100 m² for a car by its aspect, 100 m² and more
//! for the flat sides of lorries (Skolnik, *Introduction to Radar Systems*, gives 100 m² for a car,
//! 200 m² for a pickup, 2 m² for a bicycle, 1 m² for a person at microwaves); about -8 dBm² for a
//! pedestrian at 76 GHz (Yamada et al., EuMC 2005; measured from all sides by Fortuny-Guasch and
//! Chareau, JRC report EUR 25762, 2013); some decibels more for a cyclist (Belgiovane and Chen,
//! IEEE T-ITS 2017). Transmission is assumed from the height of the sensor: from a roof it sees
//! over cars, but not over buses. Micro-Doppler of limbs and wheels is neglected.

use nalgebra::{Point2, Rotation2, Vector2};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

use crate::body::{Aspect, Body, Scatterer, Wall};
use crate::town;

/// A kind of road user.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Car,
    Van,
    Lorry,
    Bus,
    Cyclist,
    Pedestrian,
}

/// A box on wheels.
struct Shape {
    half_m: (f64, f64),
    /// Median cross-section of an edge, seen from all sides, and of a panel, seen at normal
    /// incidence, m².
    edge_m2: f64,
    panel_m2: f64,
    /// Two-route share of the power that passes.
    transmission: f64,
}

impl Kind {
    /// Half of length and width, metres.
    pub fn half_m(self) -> (f64, f64) {
        match self {
            Self::Car => (2.15, 0.9),
            Self::Van => (2.75, 1.0),
            Self::Lorry => (4.6, 1.25),
            Self::Bus => (5.8, 1.27),
            Self::Cyclist => (0.9, 0.3),
            Self::Pedestrian => (0.25, 0.3),
        }
    }

    /// Draws a motor vehicle: mostly cars.
    pub fn motor_vehicle(rng: &mut impl Rng) -> Self {
        match rng.random_range(0..100) {
            0..74 => Self::Car,
            74..89 => Self::Van,
            89..95 => Self::Lorry,
            _ => Self::Bus,
        }
    }

    /// Draws a body of this kind around its own origin, x ahead.
    pub fn body(self, number: u32, rng: &mut ChaCha8Rng) -> Body {
        let half_m = self.half_m();
        let on_wheels = |edge_m2, panel_m2, transmission| Shape {
            half_m,
            edge_m2,
            panel_m2,
            transmission,
        };
        match self {
            Self::Car => town::car(number, rng),
            Self::Van => on_wheels(3.0, 15.0, 0.2).body(number, rng),
            Self::Lorry => on_wheels(6.0, 40.0, 0.05).body(number, rng),
            Self::Bus => on_wheels(5.0, 40.0, 0.05).body(number, rng),
            Self::Cyclist => cloud(number, half_m, 5, 0.2, rng),
            Self::Pedestrian => cloud(number, half_m, 2, 0.1, rng),
        }
    }
}

impl Shape {
    fn body(&self, number: u32, rng: &mut ChaCha8Rng) -> Body {
        let (length, width) = self.half_m;
        let corners = [
            (length, width),
            (length, -width),
            (-length, -width),
            (-length, width),
        ]
        .map(|(x, y)| Point2::new(x, y));
        let mut body = Body::default();
        for side in 0..4 {
            let (from, to) = (corners[side], corners[(side + 1) % 4]);
            let cross_section_m2 = spread(rng, self.edge_m2, 4.0);
            body.scatterers
                .push(Scatterer::all_round(from, cross_section_m2, number));
            self.panels(&mut body, from, to, number, rng);
        }
        let transmission = self.transmission.sqrt();
        // A line through the outline crosses at least one diagonal, half of the lines both.
        let diagonal =
            |a: usize, b: usize| Wall::rough(corners[a], corners[b], transmission, number);
        body.walls = vec![diagonal(0, 2), diagonal(1, 3)];
        body
    }

    /// Adds about one panel for each metre: flat, hence bright at normal incidence, but slightly
    /// tilted.
    fn panels(
        &self,
        body: &mut Body,
        from: Point2<f64>,
        to: Point2<f64>,
        number: u32,
        rng: &mut ChaCha8Rng,
    ) {
        let route = to - from;
        let outward = Vector2::new(-route.y, route.x).normalize();
        let count = route.norm().ceil() as usize;
        for panel in 0..count {
            let position =
                from + route * ((panel as f64 + rng.random_range(0.2..0.8)) / count as f64);
            let normal = Rotation2::new(rng.random_range(-0.15..0.15)) * outward;
            let aspect = Aspect::Facing {
                normal,
                sharpness: rng.random_range(10.0..120.0),
            };
            let cross_section_m2 = spread(rng, self.panel_m2, 5.0);
            body.scatterers.push(Scatterer {
                position,
                cross_section_m2,
                aspect,
                body: number,
            });
        }
    }
}

/// Weak scatterers all around, without walls.
fn cloud(
    number: u32,
    half_m: (f64, f64),
    count: usize,
    median_m2: f64,
    rng: &mut ChaCha8Rng,
) -> Body {
    let mut body = Body::default();
    for _ in 0..count {
        let position = Point2::new(
            rng.random_range(-half_m.0..half_m.0),
            rng.random_range(-half_m.1..half_m.1),
        );
        let cross_section_m2 = spread(rng, median_m2, 3.0);
        body.scatterers
            .push(Scatterer::all_round(position, cross_section_m2, number));
    }
    body
}

/// A log-normal number with a median and a standard deviation in decibels.
fn spread(rng: &mut ChaCha8Rng, median: f64, deviation_db: f64) -> f64 {
    // The sum of twelve uniform numbers is close to normal and has no outliers.
    let normal = (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
    median * 10f64.powf(deviation_db * normal / 10.0)
}
