//! Boundaries between lots, and vegetation.

use nalgebra::{Point2, Vector2};
use rand::Rng;

use super::facade::right_of;
use super::random::{random_positions, smooth};
use super::site::{Screen, Site};
use crate::body::NO_BODY;

/// Share of the echo of trees and bushes that is of their leaves.
const LEAFY: f64 = 0.7;
/// Scale of the ragged edge of undergrowth, metres.
const RAGGED_M: f64 = 9.0;

/// A kind of boundary.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Boundary {
    Hedge,
    /// Boards between posts.
    Fence,
    /// Thin bars: nearly transparent, and bright along the bars.
    Railing,
    Wall,
    /// Posts with wires between.
    Wire,
    /// A crash barrier: long, regular and specular.
    Barrier,
}

/// The properties of a boundary. All are lower than a radar on a roof, which sees higher objects
/// behind them. Hedges: Weissberger's attenuation of 1.55 dB a metre of foliage at 77 GHz, two-way.
struct Make {
    screen: Screen,
    /// Distance between posts, metres; 0 without posts.
    posts_m: f64,
    post_m2: f64,
    /// Distance between the scatterers of the filling, metres.
    filling_m: f64,
    filling_m2: f64,
    /// Maximum offset of the filling's scatterers to both sides, metres.
    thickness_m: f64,
    /// Cross-section of a flash at normal incidence, square metres for each 4 m.
    flash_m2: f64,
}

impl Boundary {
    fn make(self) -> Make {
        let make = |transmission, mirror, posts, filling, thickness_m, flash_m2| {
            let ((posts_m, post_m2), (filling_m, filling_m2)): ((f64, f64), (f64, f64)) =
                (posts, filling);
            let screen = Screen {
                transmission,
                mirror,
            };
            Make {
                screen,
                posts_m,
                post_m2,
                filling_m,
                filling_m2,
                thickness_m,
                flash_m2,
            }
        };
        match self {
            Self::Hedge => make(0.5, 0.0, (0.0, 0.0), (0.45, 0.08), 0.4, 0.0),
            Self::Fence => make(0.6, 0.03, (1.8, 0.4), (0.8, 0.08), 0.03, 3.0),
            Self::Railing => make(0.9, 0.1, (2.4, 1.5), (0.6, 0.12), 0.02, 2.0),
            Self::Wall => make(0.5, 0.08, (0.0, 0.0), (0.5, 0.08), 0.05, 10.0),
            Self::Wire => make(0.97, 0.0, (3.0, 0.4), (2.0, 0.02), 0.02, 0.0),
            Self::Barrier => make(0.8, 0.5, (2.0, 1.5), (1.0, 0.1), 0.02, 60.0),
        }
    }
}

impl Site<'_> {
    /// Adds a boundary between two places, if it is longer than a metre.
    pub(super) fn boundary(&mut self, kind: Boundary, from: Point2<f64>, to: Point2<f64>) {
        let direction = to - from;
        let length_m = direction.norm();
        if length_m < 1.0 {
            return;
        }
        let (along, make, body) = (direction / length_m, kind.make(), self.body());
        let outward = right_of(direction);
        self.wall(from, to, make.screen, body);
        let posts = if make.posts_m > 0.0 {
            (length_m / make.posts_m) as usize + 1
        } else {
            0
        };
        for post in 0..posts {
            self.point(
                from + along * (post as f64 * make.posts_m),
                make.post_m2,
                3.0,
                body,
            );
        }
        for at in random_positions(
            &mut self.rng,
            length_m,
            0.5 * make.filling_m,
            1.5 * make.filling_m,
        ) {
            let aside = self.rng.random_range(-make.thickness_m..make.thickness_m);
            self.point(
                from + along * at + outward * aside,
                make.filling_m2,
                5.0,
                body,
            );
        }
        self.flashes([from, to], outward, make.flash_m2, body);
    }

    /// Smooth pieces, on both sides.
    fn flashes(&mut self, ends: [Point2<f64>; 2], outward: Vector2<f64>, flash_m2: f64, body: u32) {
        if flash_m2 == 0.0 {
            return;
        }
        let direction = ends[1] - ends[0];
        for share in random_positions(
            &mut self.rng,
            1.0,
            2.0 / direction.norm(),
            6.0 / direction.norm(),
        ) {
            for side in [-1.0, 1.0] {
                self.facing(
                    ends[0] + direction * share,
                    outward * side,
                    250.0,
                    flash_m2,
                    body,
                );
            }
        }
    }

    /// Adds a tree: a trunk, branches around it, and a crown that attenuates.
    pub(super) fn tree(&mut self, place: Point2<f64>, reach_m: f64) {
        let crown_m = self.between(0.5, 1.0);
        self.cloud(place, 1, 0.1, 0.2, 1.5);
        let leaves = self.changes.leaves;
        let crown_m2 = 0.15 * (1.0 - LEAFY * (1.0 - leaves));
        self.changing(place, |site| {
            site.cloud(place, 9, crown_m, reach_m, crown_m2);
        });
        let half = Vector2::new(crown_m.min(reach_m), 0.0);
        let crown = Screen {
            transmission: 1.0 - 0.2 * leaves,
            mirror: 0.0,
        };
        self.wall(place - half, place + half, crown, NO_BODY);
        self.wall(place - half.yx(), place + half.yx(), crown, NO_BODY);
    }

    /// Adds weak scatterers all over an area: bushes, bins, roughness.
    pub(super) fn clutter(
        &mut self,
        from: Point2<f64>,
        size: Vector2<f64>,
        per_m2: f64,
        median_m2: f64,
    ) {
        for _ in 0..(size.x * size.y * per_m2).max(0.0) as usize {
            let share = Vector2::from_fn(|_, _| self.rng.random::<f64>());
            self.point(from + size.component_mul(&share), median_m2, 6.0, NO_BODY);
        }
    }

    /// Adds undergrowth: an area of weak scatterers with a ragged edge.
    pub(super) fn undergrowth(
        &mut self,
        from: Point2<f64>,
        size: Vector2<f64>,
        per_m2: f64,
        median_m2: f64,
    ) {
        let key = self.rng.random();
        let median_m2 = median_m2 * (1.0 - LEAFY * (1.0 - self.changes.leaves));
        self.changing(from, |site| {
            for _ in 0..(size.x * size.y * per_m2).max(0.0) as usize {
                let share = Vector2::from_fn(|_, _| site.rng.random::<f64>());
                let place = from + size.component_mul(&share);
                let from_middle = 2.0 * share - Vector2::repeat(1.0);
                let cover = 1.5 * smooth(key, place, RAGGED_M) + 0.2 - from_middle.norm_squared();
                if cover > 0.0 {
                    site.point(place, median_m2 * cover, 6.0, NO_BODY);
                }
            }
        });
    }
}
