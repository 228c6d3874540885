//! Facades: the scatterers of a wall.
//!
//! In real scans a row of houses appears as short bright pieces and dots with gaps between. So a
//! facade consists of regular bays, each with its own strength: rough wall (many weak scatterers,
//! whose echoes interfere), relief between the bays, which appears as a row of dots along a street,
//! and in some of them windows (reveals that face along the street, a pane that flashes at normal
//! incidence, a room that extends the echo in range), doors (a recess: two walls and the ground,
//! bright over a wide angle) and drain pipes. Cross-sections are fitted to the histogram of powers
//! in real scans.

use nalgebra::{Point2, Rotation2, Vector2};
use rand::Rng;

use super::random::{normal, random_positions};
use super::site::{Screen, Site};

/// The material of a wall.
///
/// The mirrored share follows from the relative permittivities of ITU-R P.2040 at normal incidence
/// (brick 3.9: 0.11, concrete 5.2: 0.15, glass 6.3: 0.19 for each surface, wood 2.0: 0.03), reduced
/// by roughness and increased by coatings. The transmitted share is larger than that of the
/// material alone, since windows transmit more and a radar in the plane cannot see over anything.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Material {
    Brick,
    /// Concrete or rendered walls with large windows: flats, offices.
    Concrete,
    /// Shop and office fronts.
    Glass,
    /// Barns, halls and garage doors.
    Metal,
    Timber,
}

impl Material {
    fn screen(self) -> Screen {
        let (transmission, mirror) = match self {
            Self::Brick => (0.1, 0.08),
            Self::Concrete => (0.06, 0.12),
            Self::Glass => (0.12, 0.5),
            Self::Metal => (0.003, 0.6),
            Self::Timber => (0.3, 0.03),
        };
        Screen {
            transmission,
            mirror,
        }
    }

    /// Factor on the roughness, and the shares of bays with a window, a door and a drain pipe.
    fn bays(self) -> (f64, [f64; 3]) {
        match self {
            Self::Brick => (1.0, [0.45, 0.12, 0.16]),
            Self::Concrete => (0.7, [0.6, 0.08, 0.1]),
            Self::Glass => (0.3, [0.9, 0.1, 0.03]),
            Self::Metal => (0.4, [0.0, 0.12, 0.1]),
            Self::Timber => (0.5, [0.0, 0.05, 0.0]),
        }
    }
}

/// One wall, seen from outside.
pub(super) struct Facade {
    /// The wall's ends in the site's frame; outside is on the right when going from the first to
    /// the second.
    pub from: Point2<f64>,
    pub to: Point2<f64>,
    pub material: Material,
    /// Density of detail: 1 towards a street, less on sides and backs.
    pub detail: f64,
    /// Distance between the centres of its windows, metres.
    pub bay_m: f64,
    /// Depth of the rooms behind the wall, metres.
    pub inside_m: f64,
    pub body: u32,
}

/// A part of a facade with its own strength.
struct Bay {
    from: Point2<f64>,
    along: Vector2<f64>,
    outward: Vector2<f64>,
    width_m: f64,
    strength: f64,
}

impl Bay {
    fn at(&self, along_m: f64, out_m: f64) -> Point2<f64> {
        self.from + self.along * along_m + self.outward * out_m
    }
}

/// Unit vector to the right of a direction.
pub(super) fn right_of(direction: Vector2<f64>) -> Vector2<f64> {
    Vector2::new(direction.y, -direction.x)
        .try_normalize(1e-9)
        .unwrap_or_else(Vector2::x)
}

impl Site<'_> {
    pub(super) fn facade(&mut self, facade: &Facade) {
        let direction = facade.to - facade.from;
        let length_m = direction.norm();
        self.wall(
            facade.from,
            facade.to,
            facade.material.screen(),
            facade.body,
        );
        let (along, outward) = (direction / length_m, right_of(direction));
        let bays = (length_m / facade.bay_m).round().max(1.0);
        let width_m = length_m / bays;
        for number in 0..bays as usize {
            let from = facade.from + along * (number as f64 * width_m);
            let strength = facade.detail * 10f64.powf(0.5 * normal(&mut self.rng));
            self.bay(
                &Bay {
                    from,
                    along,
                    outward,
                    width_m,
                    strength,
                },
                facade,
            );
        }
    }

    fn bay(&mut self, bay: &Bay, facade: &Facade) {
        let (roughness, [window, door, pipe]) = facade.material.bays();
        self.rough_wall(bay, roughness, facade);
        if self.chance(window) {
            self.window(bay, facade);
        }
        if self.chance(door) {
            self.door(bay, facade.body);
        }
        // Pilasters, gutters and panel joints at the side of every bay, visible along the street
        // from far away.
        let relief_m2 = if self.chance(pipe) { 5.0 } else { 1.6 };
        self.facing(
            bay.at(0.0, 0.1),
            bay.outward,
            0.4,
            relief_m2 * bay.strength,
            facade.body,
        );
    }

    fn rough_wall(&mut self, bay: &Bay, roughness: f64, facade: &Facade) {
        for at in random_positions(
            &mut self.rng,
            bay.width_m,
            0.1 / facade.detail,
            0.35 / facade.detail,
        ) {
            let place = bay.at(at, self.rng.random_range(0.0..0.15));
            self.facing(
                place,
                bay.outward,
                1.5,
                0.15 * roughness * bay.strength,
                facade.body,
            );
        }
    }

    /// Reveals on both sides, a pane, and the room behind it.
    fn window(&mut self, bay: &Bay, facade: &Facade) {
        let half_m = self.between(0.3, 0.8).min(bay.width_m / 2.0);
        let middle_m = bay.width_m / 2.0;
        for side in [-1.0, 1.0] {
            let direction = Rotation2::new(side * self.rng.random_range(0.7..1.4)) * bay.outward;
            let sharpness = self.rng.random_range(2.0..10.0);
            self.facing(
                bay.at(middle_m + side * half_m, 0.05),
                direction,
                sharpness,
                10.0 * bay.strength,
                facade.body,
            );
        }
        // Panes are not quite parallel to their wall.
        let direction = Rotation2::new(0.02 * normal(&mut self.rng)) * bay.outward;
        let pane_m2 = if facade.material == Material::Glass {
            160.0
        } else {
            40.0
        };
        self.facing(
            bay.at(middle_m, 0.0),
            direction,
            250.0,
            pane_m2,
            facade.body,
        );
        for _ in 0..(4.0 * facade.detail).round() as usize {
            let depth_m = -1.8 * (1.0 - self.rng.random::<f64>()).ln();
            let place = bay.at(
                middle_m + self.rng.random_range(-half_m..half_m),
                -depth_m.min(facade.inside_m),
            );
            self.facing(place, bay.outward, 1.5, 0.3 * bay.strength, facade.body);
        }
    }

    /// A recess whose jambs and steps form dihedrals.
    fn door(&mut self, bay: &Bay, body: u32) {
        let at = self.between(0.0, bay.width_m);
        for side in [-1.0, 1.0] {
            let direction = bay.outward + bay.along * side;
            self.facing(
                bay.at(at + 0.45 * side, -0.1),
                direction,
                3.0,
                5.0 * bay.strength,
                body,
            );
        }
    }
}
