//! The buildings and other objects of a lot, by its use.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::{Point2, Vector2};
use rand::Rng;

use super::boundary::Boundary;
use super::building::{Building, Form, Room};
use super::config::TownConfig;
use super::district::Use;
use super::facade::Material;
use super::random::generator;
use super::site::Site;
use super::terrace::TerraceStyle;

/// Distance between a terraced house and the side of its lot, metres.
const PARTY_M: f64 = 0.03;

/// A lot to be built on, from the street (`y` = 0) backwards; everything stays inside.
pub(super) struct Plot<'a, 's> {
    pub site: Site<'s>,
    pub config: &'a TownConfig,
    pub width_m: f64,
    pub depth_m: f64,
    /// The seed that the plots of a stretch share.
    pub row_key: u64,
    /// Detail of its buildings: 1 along a street, less behind.
    pub detail: f64,
}

impl Plot<'_, '_> {
    pub(super) fn build(&mut self, kind: Use) {
        match kind {
            Use::Terrace => self.terrace(),
            Use::Detached => self.detached(),
            Use::Flats => self.flats(),
            Use::Hall => self.hall(),
            Use::Church => self.church(),
            Use::Green => self.green(),
            Use::CarPark => self.car_park(),
            Use::Field => self.field(),
            Use::Farm => self.farm(),
            Use::Alley => self.alley(),
            Use::Yards => self.yards(0.5),
        }
    }

    pub(super) fn at(&self, x: f64, y: f64) -> Point2<f64> {
        Point2::new(x.clamp(0.0, self.width_m), y.clamp(0.0, self.depth_m))
    }

    fn house(&mut self, room: Room, form: Form, front: Material, rest: Material) {
        self.site.building(&Building {
            room,
            form,
            front,
            rest,
            detail: self.detail,
            balconies_m: 0.0,
        });
    }

    /// Adds a boundary across the plot, `y` metres from the street, with a gap for a gate.
    fn across(&mut self, kind: Boundary, y: f64) {
        let gate_m = self.site.between(1.0, (self.width_m - 4.0).max(1.0));
        let [left, gate, beyond, right] =
            [0.3, gate_m, gate_m + 3.2, self.width_m - 0.3].map(|x| self.at(x, y));
        self.site.boundary(kind, left, gate);
        if beyond.x < right.x {
            self.site.boundary(kind, beyond, right);
        }
    }

    /// Adds a boundary along the plot's left side, from `y` to its back.
    fn aside(&mut self, kind: Boundary, y: f64) {
        let (from, to) = (self.at(0.1, y + 0.2), self.at(0.1, self.depth_m - 0.2));
        if from.y < to.y {
            self.site.boundary(kind, from, to);
        }
    }

    /// Adds trees, with a density for a thousand square metres, from `y` to the back.
    fn trees(&mut self, y: f64, per_1000_m2: f64) {
        let area_m2 = self.width_m * (self.depth_m - y).max(0.0);
        let wanted = per_1000_m2 * 1e-3 * area_m2 * self.config.trees;
        let count = wanted as usize + usize::from(self.site.chance(wanted.fract()));
        for _ in 0..count {
            let (x, y) = (
                self.site.between(1.6, self.width_m - 1.6),
                self.site.between(y + 1.6, self.depth_m - 1.6),
            );
            let place = self.at(x, y);
            self.site.tree(place, 1.5);
        }
    }

    pub(super) fn clutter(&mut self, y: f64, per_m2: f64, median_m2: f64) {
        let size = Vector2::new(self.width_m, self.depth_m - y);
        self.site
            .clutter(Point2::new(0.0, y), size, per_m2, median_m2);
    }

    /// Adds grass, and on a share of plots undergrowth that covers everything.
    fn ground(&mut self, rough: f64) {
        self.clutter(0.5, 0.04, 0.02);
        if self.site.chance(rough) {
            let size = Vector2::new(self.width_m, self.depth_m - 0.5);
            self.site
                .undergrowth(Point2::new(0.0, 0.5), size, 1.2, 0.05);
        }
    }

    /// A terraced house: most houses of a terrace share setback and material.
    fn terrace(&mut self) {
        let style = TerraceStyle::draw(&mut if self.site.chance(0.75) {
            generator(&[self.row_key])
        } else {
            generator(&[self.site.rng.random()])
        });
        let depth_m = self
            .site
            .between(9.0, 13.0)
            .min(self.depth_m - style.setback_m);
        let room = Room::at(
            [PARTY_M, style.setback_m],
            [self.width_m - 2.0 * PARTY_M, depth_m],
        );
        let form = match self.site.between(0.0, 1.0) {
            ..0.6 => Form::Plain,
            ..0.75 => Form::Stepped,
            _ => Form::Angle,
        };
        self.house(room, form, style.front, Material::Brick);
        if let Some(kind) = style.before {
            self.across(kind, 0.2);
        }
        self.yards(style.setback_m + depth_m);
    }

    /// Behind houses: walls at one side and at the back, a shed, bins.
    fn yards(&mut self, y: f64) {
        if self.depth_m - y < 3.0 {
            return;
        }
        let kind = self.site.either(0.6, Boundary::Wall, Boundary::Fence);
        self.aside(kind, y);
        self.across(kind, self.depth_m - 0.3);
        if self.depth_m - y > 5.0 && self.site.chance(0.4) {
            let room = Room::at([0.5, self.depth_m - 3.2], [2.5, 2.0]);
            self.house(room, Form::Plain, Material::Timber, Material::Timber);
        }
        self.trees(y, 2.0);
        self.clutter(y, 0.06, 0.06);
    }

    fn detached(&mut self) {
        let garden_m = self.site.between(4.0, 8.0);
        let front = match self.site.between(0.0, 1.0) {
            ..0.35 => Some(Boundary::Hedge),
            ..0.6 => Some(Boundary::Wall),
            ..0.8 => Some(Boundary::Fence),
            ..0.87 => Some(Boundary::Railing),
            _ => None,
        };
        if let Some(kind) = front {
            self.across(kind, 0.5);
        }
        let width_m = self.site.between(6.5, 10.5).min(self.width_m - 4.4);
        let depth_m = self.site.between(7.0, 10.0);
        let form = self.site.either(0.5, Form::Stepped, Form::Angle);
        self.house(
            Room::at([1.0, garden_m], [width_m, depth_m]),
            form,
            Material::Brick,
            Material::Brick,
        );
        self.drive(1.0 + width_m + 0.3, garden_m);
        self.aside(Boundary::Fence, garden_m);
        self.across(Boundary::Fence, self.depth_m - 0.4);
        self.trees(garden_m + depth_m + 1.0, 5.0);
        self.clutter(0.5, 0.04, 0.03);
    }

    /// A garage beside the house, and on some plots a car in front of it.
    fn drive(&mut self, x: f64, garden_m: f64) {
        let y = garden_m + self.site.between(1.0, 3.0);
        if self.site.chance(0.6) {
            self.house(
                Room::at([x, y], [2.8, 5.5]),
                Form::Plain,
                Material::Metal,
                Material::Brick,
            );
        }
        if garden_m > 5.0 {
            let (place, taken) = (self.at(x + 1.4, y - 2.6), self.config.parked_cars);
            self.site.changing(place, |site| {
                if site.chance(taken) {
                    site.parked_car(place, FRAC_PI_2);
                }
            });
        }
    }

    fn flats(&mut self) {
        let setback_m = self.site.between(3.0, 7.0);
        let depth_m = self.site.between(11.0, 15.0).min(self.depth_m - setback_m);
        let room = Room::at([1.5, setback_m], [self.width_m - 3.0, depth_m]);
        let form = self.site.either(0.5, Form::Plain, Form::Stepped);
        let (front, rest, detail) = (Material::Concrete, Material::Concrete, self.detail);
        self.site.building(&Building {
            room,
            form,
            front,
            rest,
            detail,
            balconies_m: 3.6,
        });
        let front = self.site.either(0.5, Boundary::Railing, Boundary::Hedge);
        self.across(front, 0.6);
        self.parking(setback_m + depth_m + 4.0);
        self.clutter(0.5, 0.02, 0.03);
    }

    fn hall(&mut self) {
        let setback_m = self.site.between(4.0, (0.4 * self.depth_m).max(4.5));
        let depth_m = (self.depth_m - setback_m) * self.site.between(0.6, 0.95);
        let room = Room::at([2.0, setback_m], [self.width_m - 4.0, depth_m]);
        let form = match self.site.between(0.0, 1.0) {
            ..0.35 => Form::Plain,
            ..0.7 => Form::Angle,
            _ => Form::Stepped,
        };
        let (front, rest) = match self.site.between(0.0, 1.0) {
            ..0.4 => (Material::Glass, Material::Concrete),
            ..0.7 => (Material::Brick, Material::Concrete),
            _ => (Material::Metal, Material::Metal),
        };
        self.house(room, form, front, rest);
        if setback_m > 9.0 {
            self.row_of_cars(2.9);
        }
        self.trees(0.0, 1.0);
    }

    fn church(&mut self) {
        let room = Room::at(
            [5.0, 5.0],
            [self.width_m - 10.0, (self.depth_m - 6.0).min(34.0)],
        );
        self.house(room, Form::Church, Material::Brick, Material::Brick);
        let front = self.site.either(0.5, Boundary::Railing, Boundary::Wall);
        self.across(front, 0.4);
        // Gravestones.
        self.clutter(1.0, 0.05, 0.15);
    }

    fn green(&mut self) {
        match self.site.between(0.0, 1.0) {
            ..0.3 => self.across(Boundary::Railing, 0.5),
            ..0.6 => self.across(Boundary::Hedge, 0.8),
            _ => {}
        }
        self.trees(1.0, 9.0);
        self.ground(0.4);
    }

    fn car_park(&mut self) {
        match self.site.between(0.0, 1.0) {
            ..0.3 => self.across(Boundary::Wall, 0.4),
            ..0.5 => self.across(Boundary::Hedge, 0.8),
            ..0.7 => self.across(Boundary::Barrier, 0.4),
            _ => {}
        }
        self.parking(4.0);
        for x in [0.25, 0.75] {
            let place = self.at(self.width_m * x, self.depth_m / 2.0);
            self.site.post(place);
        }
    }

    /// Rows of parked cars from `y` to the back, with lanes between.
    fn parking(&mut self, y: f64) {
        let mut row = y;
        let mut pair = 5.0;
        while row < self.depth_m - 2.5 {
            self.row_of_cars(row);
            row += pair;
            pair = 16.0 - pair;
        }
    }

    /// Cars side by side, `y` metres from the street.
    fn row_of_cars(&mut self, y: f64) {
        for bay in 1..(self.width_m / 2.5) as usize {
            let (place, taken) = (self.at(2.5 * bay as f64, y), 0.8 * self.config.parked_cars);
            self.site.changing(place, |site| {
                if site.chance(taken) {
                    let ahead = if site.chance(0.5) { 1.0 } else { -1.0 };
                    site.parked_car(place, ahead * FRAC_PI_2);
                }
            });
        }
    }

    fn field(&mut self) {
        match self.site.between(0.0, 1.0) {
            ..0.45 => self.across(Boundary::Hedge, 1.0),
            ..0.7 => self.across(Boundary::Wire, 0.6),
            ..0.78 => self.across(Boundary::Wall, 0.6),
            _ => {}
        }
        if self.site.chance(0.4) {
            let kind = self.site.either(0.6, Boundary::Hedge, Boundary::Wire);
            self.aside(kind, 2.0);
        }
        let wooded = if self.site.chance(0.2) { 12.0 } else { 1.5 };
        self.trees(1.0, wooded);
        self.ground(0.3);
    }

    fn farm(&mut self) {
        let wide_m = self.width_m - 20.0;
        let house = Room::at([3.0, 6.0], [11.0, 9.0]);
        self.house(house, Form::Angle, Material::Brick, Material::Brick);
        let barn = Room::at([18.0, 9.0], [wide_m, (self.depth_m - 12.0).min(20.0)]);
        self.house(barn, Form::Plain, Material::Metal, Material::Metal);
        self.across(Boundary::Wall, 0.6);
        let place = self.at(15.0, 4.0);
        self.site
            .changing(place, |site| site.parked_car(place, PI / 3.0));
        self.clutter(2.0, 0.05, 0.1);
    }

    fn alley(&mut self) {
        if self.site.chance(0.4) {
            let (from, to) = (self.at(0.1, 1.0), self.at(self.width_m - 0.1, 1.0));
            self.site.boundary(Boundary::Fence, from, to);
        }
        self.clutter(0.5, 0.1, 0.1);
    }
}
