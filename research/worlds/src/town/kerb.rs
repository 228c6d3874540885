//! Objects between a street and its lots: posts, signs, trees, parked cars, barriers.
//!
//! A post is a metal cylinder, 2π r h² / λ at normal incidence (Knott, Shaeffer, Tuley: Radar Cross
//! Section), of which only the first Fresnel zone contributes: r = 0.08 m and h = 0.2 m at 20 m
//! give 5 m². A sign is a flat plate, 4π A² / λ², some thousand square metres in the same zone, but
//! hardly any sign is vertical enough to show half of it.

use nalgebra::{Point2, Rotation2, Vector2};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::boundary::Boundary;
use super::changes::Changes;
use super::config::TownConfig;
use super::district::District;
use super::frontage::Frontage;
use super::random::{generator, hash, normal};
use super::site::{Built, Site};
use super::vehicle::CAR_HALF_M;
use crate::body::NO_BODY;

/// Distance from the kerb to posts and signs, metres.
const POSTS_OUT_M: f64 = 0.5;
/// Distance from the kerb to the centre of parked cars, metres: they stand in bays beside the
/// carriageway.
const CARS_OUT_M: f64 = 1.25;
/// Width of the parking bays, metres.
pub(super) const BAYS_M: f64 = 2.4;
/// Length of a piece of a rail, metres.
const RAIL_M: f64 = 4.0;
/// Minimum distance of all objects from all kerbs, metres.
const FREE_M: f64 = 0.2;

/// A stretch of one side of a street.
pub(super) struct Kerb<'a> {
    pub frontage: Frontage<'a>,
    pub config: &'a TownConfig,
    pub district: District,
    /// The start and end, metres along the street.
    pub from_m: f64,
    pub to_m: f64,
    /// Distance from the kerb to the lots, including bays, metres.
    pub pavement_m: f64,
    /// True if there are parking bays.
    pub bays: bool,
    pub rng: ChaCha8Rng,
    pub changes: Changes,
}

impl Kerb<'_> {
    pub(super) fn furnish(&mut self, built: &mut Built) {
        let (_, trees) = self.district.kerb_shares();
        self.lamp_posts(built);
        self.signs(built);
        if self.bays {
            self.parked_cars(built);
        }
        if self
            .rng
            .random_bool((trees * self.config.trees).clamp(0.0, 1.0))
        {
            self.trees(built);
        }
        self.occasional(built);
        self.ground(built);
    }

    /// Distance of posts from the kerb, metres: behind the bays if there are any.
    fn posts_out_m(&self) -> f64 {
        POSTS_OUT_M + if self.bays { BAYS_M } else { 0.0 }
    }

    /// A site at a station, if the place belongs to this kerb and is free.
    fn site<'s>(
        &mut self,
        along_m: f64,
        out_m: f64,
        free_m: f64,
        built: &'s mut Built,
    ) -> Option<Site<'s>> {
        let pose = self.frontage.frame(along_m, out_m);
        let place = Point2::from(pose.translation.vector);
        let ours = self.frontage.owns(along_m, place) && self.frontage.is_clear(place, free_m);
        let rng = generator(&[self.rng.random()]);
        let changes = self.changes;
        ours.then_some(Site {
            built,
            pose,
            rng,
            changes,
        })
    }

    /// Returns whether a rectangle in the frame of a station, of half a length along the kerb and
    /// between two distances from the frame's origin, stays off all carriageways.
    fn has_room(&self, along_m: f64, out_m: f64, half_m: f64, y: [f64; 2]) -> bool {
        let frame = self.frontage.frame(along_m, out_m);
        let is_clear = |x: f64, y: f64| self.frontage.is_clear(frame * Point2::new(x, y), 0.1);
        [-1.0, -0.5, 0.0, 0.5, 1.0]
            .into_iter()
            .all(|share| y.into_iter().all(|y| is_clear(half_m * share, y)))
    }

    /// At regular distances along the whole street, on its left and right in turn.
    fn lamp_posts(&mut self, built: &mut Built) {
        let every_m = 40.0 + (hash(&[self.frontage.street_key()]) % 25) as f64;
        let first = (self.from_m / every_m - self.frontage.phase()).ceil();
        let mut along_m = (first + self.frontage.phase()) * every_m;
        while along_m < self.to_m {
            let out_m = self.posts_out_m();
            if let Some(mut site) = self.site(along_m, out_m, FREE_M, built) {
                site.post(Point2::origin());
            }
            along_m += every_m;
        }
    }

    fn signs(&mut self, built: &mut Built) {
        let every_m = if self.district == District::Country {
            90.0
        } else {
            28.0
        };
        self.along(0.2 * every_m, 1.8 * every_m, |kerb, along_m| {
            let out_m = kerb.posts_out_m();
            if let Some(mut site) = kerb.site(along_m, out_m, FREE_M, built) {
                site.sign();
            }
        });
    }

    fn trees(&mut self, built: &mut Built) {
        let every_m = self.rng.random_range(7.0..13.0);
        let out_m = self.posts_out_m() + 0.6;
        self.along(every_m, every_m + 1.0, |kerb, along_m| {
            if let Some(mut site) = kerb.site(along_m, out_m, 1.0, built) {
                site.tree(Point2::origin(), 0.55);
            }
        });
    }

    fn parked_cars(&mut self, built: &mut Built) {
        self.along(5.4, 6.6, |kerb, along_m| {
            let before = built.len();
            kerb.parking_place(along_m, built);
            // As [`Site::changing`] does.
            let place = kerb.frontage.place(along_m, CARS_OUT_M);
            if let Some(rng) = kerb.changes.generator(place) {
                built.cut_back(before);
                let of_town = std::mem::replace(&mut kerb.rng, rng);
                kerb.parking_place(along_m, built);
                kerb.rng = of_town;
            }
        });
    }

    fn parking_place(&mut self, along_m: f64, built: &mut Built) {
        if !self
            .rng
            .random_bool(self.config.parked_cars.clamp(0.0, 1.0))
        {
            return;
        }
        let (length, width) = (CAR_HALF_M.0 + 0.2, CAR_HALF_M.1);
        if !self.has_room(along_m, CARS_OUT_M, length, [-width, width]) {
            return;
        }
        if let Some(mut site) = self.site(along_m, CARS_OUT_M, FREE_M, built) {
            site.parked_car(Point2::origin(), 0.0);
        }
    }

    /// Bollards, a bus stop, railings, a crash barrier: each on a few stretches.
    fn occasional(&mut self, built: &mut Built) {
        let (urban, open) = match self.district {
            District::City => (1.0, 0.0),
            District::Suburb | District::Campus => (0.5, 0.3),
            District::Country => (0.05, 1.0),
        };
        if self.rng.random_bool(0.12 * urban) {
            self.bollards(built);
        }
        if self.rng.random_bool(0.1 * urban) {
            self.bus_stop(built);
        }
        if self.rng.random_bool(0.1 * urban) {
            self.rail(Boundary::Railing, built);
        }
        if self.rng.random_bool(0.12 * open) {
            self.rail(Boundary::Barrier, built);
        }
    }

    fn bollards(&mut self, built: &mut Built) {
        let out_m = self.posts_out_m();
        let (from_m, every_m) = (
            self.rng.random_range(self.from_m..self.to_m),
            self.rng.random_range(1.5..2.5),
        );
        for along_m in (0..12).map(|index| from_m + f64::from(index) * every_m) {
            if along_m < self.to_m
                && let Some(mut site) = self.site(along_m, out_m, FREE_M, built)
            {
                site.point(Point2::origin(), 0.8, 3.0, NO_BODY);
            }
        }
    }

    fn bus_stop(&mut self, built: &mut Built) {
        let along_m = self.rng.random_range(self.from_m..self.to_m);
        // Open to the street, with its back to the lots.
        let out_m = self.pavement_m - 1.3;
        if out_m > POSTS_OUT_M
            && self.has_room(along_m, out_m, 1.8, [0.0, 1.2])
            && let Some(mut site) = self.site(along_m, out_m, POSTS_OUT_M, built)
        {
            site.shelter();
        }
    }

    /// Adds a rail along the kerb, in pieces that follow its bends.
    fn rail(&mut self, kind: Boundary, built: &mut Built) {
        let out_m = self.posts_out_m();
        let mut along_m = self.from_m;
        while along_m + RAIL_M <= self.to_m {
            let [from, to] =
                [0.0, RAIL_M].map(|more_m| self.frontage.place(along_m + more_m, out_m));
            let is_clear = |step: i32| {
                self.frontage
                    .is_clear(from + (to - from) * (0.25 * f64::from(step)), FREE_M)
            };
            let free = (0..=4).all(is_clear) && self.frontage.owns(along_m + RAIL_M, to);
            if let Some(mut site) = self.site(along_m, out_m, FREE_M, built)
                && free
            {
                let end = site.pose.inverse_transform_point(&to);
                site.boundary(kind, Point2::origin(), end);
            }
            along_m += RAIL_M;
        }
    }

    /// Adds weak scatterers everywhere: kerb stones, drains, grass and litter.
    fn ground(&mut self, built: &mut Built) {
        self.along(2.0, 6.0, |kerb, along_m| {
            let middle_m = kerb.pavement_m / 2.0;
            let Some(mut site) = kerb.site(along_m, middle_m, middle_m - 0.1, built) else {
                return;
            };
            for _ in 0..5 {
                let (x, y) = (
                    site.rng.random_range(-2.0..2.0),
                    site.rng.random_range(-1.0..1.0) * (middle_m - 0.3),
                );
                if kerb.frontage.is_clear(site.pose * Point2::new(x, y), 0.05) {
                    site.point(Point2::new(x, y), 0.01, 6.0, NO_BODY);
                }
            }
        });
    }

    /// Calls `call` for stations along the stretch at random distances between `min_m` and `max_m`.
    fn along(&mut self, min_m: f64, max_m: f64, mut call: impl FnMut(&mut Self, f64)) {
        let mut along_m = self.from_m + self.rng.random_range(0.0..max_m);
        while along_m < self.to_m {
            call(self, along_m);
            along_m += self.rng.random_range(min_m..max_m);
        }
    }
}

impl Site<'_> {
    /// Adds a lamp post: pole, foot and door, close together.
    pub(super) fn post(&mut self, place: Point2<f64>) {
        for median_m2 in [3.0, 1.0, 0.5] {
            self.cloud(place, 1, 0.1, 0.2, median_m2);
        }
    }

    /// Adds a pole with a plate facing the traffic, whose bends and brackets reflect in all
    /// directions.
    fn sign(&mut self) {
        let body = self.body();
        let turn = Rotation2::new(0.08 * normal(&mut self.rng));
        let against = if self.chance(0.8) { -1.0 } else { 1.0 };
        self.point(Point2::origin(), 1.5, 3.0, body);
        self.facing(
            Point2::new(0.05 * against, 0.0),
            turn * Vector2::new(against, 0.0),
            400.0,
            150.0,
            body,
        );
    }
}
