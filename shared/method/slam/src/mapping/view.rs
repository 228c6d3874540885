//! The view of a keyframe: its returns, and how well it looked at each place around it.

use std::f64::consts::TAU;

use gyre_matching::Submap;
use nalgebra::{Point2, Vector2};

use crate::{Keyframe, mapping::MapOptions};

const SECTORS: usize = 360;
/// Sectors to either side that a return speaks for: a return hides weaker ones at its range within
/// the beam, so that not every azimuth has points of a wall that all of them see.
const BEAM_SECTORS: usize = 3;
/// A wall returns as much in a cell of this side as it can. A smaller cell has a share of the
/// wall's return in proportion to its side, m.
const FULL_CELL_M: f64 = 0.2;
/// A return is spread along its arc over so many standard deviations to either side.
const SPREAD_SIGMAS: f64 = 2.0;

/// The free space and the returns of a keyframe, in its own frame. Where nothing returns power it
/// may have looked at open ground or at nothing, so a sector counts as far as its farthest return.
pub struct View {
    options: MapOptions,
    points: Submap,
    farthest_m: [f64; SECTORS],
    own_m: [f64; SECTORS],
}

impl View {
    pub fn new(options: &MapOptions) -> Self {
        Self {
            options: options.clone(),
            points: Submap::default(),
            farthest_m: [0.0; SECTORS],
            own_m: [0.0; SECTORS],
        }
    }

    pub fn take(&mut self, keyframe: &Keyframe) {
        self.points.start(&keyframe.points, &keyframe.twist);
        self.own_m.fill(0.0);
        for (place, _) in places(&self.points) {
            let own_m = &mut self.own_m[sector(&place)];
            *own_m = own_m.max(place.norm());
        }
        for (k, farthest_m) in self.farthest_m.iter_mut().enumerate() {
            let beam = (0..=2 * BEAM_SECTORS)
                .map(|other| self.own_m[(k + SECTORS + other - BEAM_SECTORS) % SECTORS]);
            *farthest_m = beam.fold(0.0, f64::max);
        }
    }

    /// Returns how well a place in the keyframe's frame was looked at, from 0 to 1.
    pub fn look(&self, place: &Vector2<f64>) -> f64 {
        let range_m = place.norm();
        let options = &self.options;
        let within = range_m >= options.near_m && range_m <= options.reach_m;
        match within && range_m <= self.farthest_m[sector(place)] + 2.0 * options.cell_m {
            true => 1.0 / (1.0 + (range_m / options.half_weight_m).powi(2)),
            false => 0.0,
        }
    }

    /// Returns the places of all returns, m, with their weights from 0 to 1.
    pub fn points(&self) -> impl Iterator<Item = (Vector2<f64>, f64)> {
        places(&self.points)
    }

    /// Calls `take` with the place of each part of a return, m, and the amount that it adds there.
    pub(crate) fn returns(&self, mut take: impl FnMut(Point2<f64>, f64)) {
        let share = FULL_CELL_M / self.options.cell_m;
        for (place, weight) in places(&self.points) {
            let amount = share * weight * self.look(&place);
            if amount > 0.0 {
                self.spread(&place, amount, &mut take);
            }
        }
    }

    /// Spreads a return along its arc as its bearing is uncertain, in parts a cell apart.
    fn spread(&self, place: &Vector2<f64>, amount: f64, take: &mut impl FnMut(Point2<f64>, f64)) {
        let sigma_m = self.options.bearing_deg.to_radians() * place.norm();
        let side = (SPREAD_SIGMAS * sigma_m / self.options.cell_m).round() as i32;
        let tangent = Vector2::new(-place.y, place.x) / place.norm().max(f64::MIN_POSITIVE);
        let aside_m = |k: i32| f64::from(k) * self.options.cell_m;
        let share = |k: i32| match side {
            0 => 1.0,
            _ => (-0.5 * (aside_m(k) / sigma_m).powi(2)).exp(),
        };
        let total: f64 = (-side..=side).map(share).sum();
        for k in -side..=side {
            let place = Point2::from(place + tangent * aside_m(k));
            take(place, amount * share(k) / total);
        }
    }
}

fn places(points: &Submap) -> impl Iterator<Item = (Vector2<f64>, f64)> {
    let places = points.points().map(|[x_m, y_m, weight]| {
        let place = Vector2::new(f64::from(x_m), f64::from(y_m));
        (place, f64::from(weight))
    });
    places.filter(|(place, weight)| *weight > 0.0 && place.norm().is_finite())
}

fn sector(place: &Vector2<f64>) -> usize {
    let turns = place.y.atan2(place.x) / TAU + 0.5;
    (turns * SECTORS as f64) as usize % SECTORS
}
