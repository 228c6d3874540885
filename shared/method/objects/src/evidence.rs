//! Where the last scans saw something.
//!
//! A grid that wraps around covers the surroundings of the sensor. Each cell remembers in which of
//! the last 32 scans it had a return. A place that was in view of these scans and had none was
//! free. What an obstacle hides counts as in view too: a vehicle that appears behind another one is
//! new, and its speed has to tell that it stands.

use std::collections::VecDeque;

use nalgebra::{Point2, Vector2};

use crate::returns::Return;

/// Side of a cell, m: three range cells.
const CELL_M: f64 = 0.5;
/// Cells a side: 256 m, twice the largest range and the way of the remembered scans.
const SIDE: i32 = 512;
/// Distance to the ends of the range within which a place is not reliably in view, m.
const EDGE_M: f64 = 1.0;
/// The last scans in which a vehicle may have been at the place that it has now: one of 5 m that is
/// faster than 7 m/s. At the start of a drive, half of the scans.
const OWN_SCANS: u32 = 3;
/// Distance before an object within which what stands does not hide it, m: a car is 5 m long.
const CLEAR_M: f64 = 3.0;
/// Share of the views with a return in a cell of what stands: a firm wall returns in most scans.
const STANDING_SHARE: f64 = 0.6;
/// The range below which points are not extracted, m.
const NEAREST_M: f64 = 5.0;

/// The memory of returns.
#[derive(Clone, Debug)]
pub(crate) struct Evidence {
    cells: Vec<Cell>,
    /// Positions of the sensor in the last scans, the newest first.
    sensors: VecDeque<Point2<f64>>,
    memory_scans: u32,
    max_range_m: f64,
    /// Standard deviation of a return's bearing, rad.
    bearing_sigma_rad: f64,
    scan: u32,
}

#[derive(Clone, Copy, Debug, Default)]
struct Cell {
    /// The place that it stands for, by its cells from the origin.
    place: [i32; 2],
    /// Bit k is set if there was a return k scans before `scan`.
    hits: u32,
    scan: u32,
}

/// The history of a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct History {
    /// Scans in which it was in view.
    pub views: u32,
    /// Those with a return there.
    pub hits: u32,
}

impl History {
    /// Returns the share of the views with a return; 1 if there are fewer views than `min_views`.
    pub fn share(&self, min_views: u32) -> f64 {
        match self.views >= min_views.max(1) {
            // A single return may be of what passed.
            true => f64::from(self.hits.saturating_sub(1)) / f64::from(self.views),
            false => 1.0,
        }
    }
}

impl Evidence {
    pub fn new(memory_scans: u32, max_range_m: f64, bearing_sigma_rad: f64) -> Self {
        Self {
            cells: vec![Cell::default(); (SIDE * SIDE) as usize],
            sensors: VecDeque::with_capacity(memory_scans as usize + 1),
            memory_scans,
            max_range_m,
            bearing_sigma_rad,
            scan: 0,
        }
    }

    /// Returns what the scans before saw where a return is, within its uncertainty.
    pub fn history(&self, found: &Return) -> History {
        let views = self.views(&found.at);
        // Two standard deviations of the bearing across, and one cell for the rest.
        let across_m = 2.0 * self.bearing_sigma_rad * found.range_m;
        let steps = (across_m / CELL_M).ceil() as i32;
        let side = Vector2::new(-found.direction.y, found.direction.x);
        let mut hits = 0;
        for step in -steps..=steps {
            let centre = found.at + side * (f64::from(step) * across_m / f64::from(steps.max(1)));
            hits |= self.hits_around(&centre);
        }
        // What came a moment ago may be the same object.
        let own = OWN_SCANS.min(self.sensors.len() as u32 / 2);
        let views = views & (u32::MAX << own);
        History {
            views: views.count_ones(),
            hits: (hits & views).count_ones(),
        }
    }

    /// The scans in which a place was in view, as the bits of a cell.
    fn views(&self, place: &Point2<f64>) -> u32 {
        let in_view = |sensor: &Point2<f64>| {
            let range_m = (place - sensor).norm();
            (NEAREST_M + EDGE_M..self.max_range_m - EDGE_M).contains(&range_m)
        };
        let views = self.sensors.iter().enumerate();
        views.fold(0, |bits, (ago, sensor)| {
            bits | (u32::from(in_view(sensor)) << ago)
        })
    }

    /// The scans with a return in a cell or one beside it.
    fn hits_around(&self, place: &Point2<f64>) -> u32 {
        let [x, y] = cell_at(place);
        let around = (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| [x + dx, y + dy]));
        around.fold(0, |bits, place| bits | self.hits(place))
    }

    /// Returns whether the newest scan that was added has a return at a place.
    pub fn is_occupied(&self, place: &Point2<f64>) -> bool {
        self.hits_around(place) & 1 != 0
    }

    /// Bit k: a return k scans before the newest one that was added.
    fn hits(&self, place: [i32; 2]) -> u32 {
        let cell = &self.cells[index(place)];
        let ago = self.scan.wrapping_sub(cell.scan);
        match cell.place == place && ago < self.memory_scans {
            true => cell.hits << ago & mask(self.memory_scans),
            false => 0,
        }
    }

    /// Adds a scan: the returns that do not belong to moving objects.
    pub fn add<'a>(&mut self, sensor: Point2<f64>, standing: impl Iterator<Item = &'a Return>) {
        self.scan += 1;
        self.sensors.push_front(sensor);
        self.sensors.truncate(self.memory_scans as usize);
        for found in standing {
            let place = cell_at(&found.at);
            let hits = self.hits(place) | 1;
            self.cells[index(place)] = Cell {
                place,
                hits,
                scan: self.scan,
            };
        }
    }

    /// Returns whether something that stands is on the way from the sensor to a place, and not just
    /// before it.
    pub fn is_behind_standing(&self, sensor: &Point2<f64>, place: &Point2<f64>) -> bool {
        let ray = place - sensor;
        let range_m = ray.norm();
        let steps = ((range_m - CLEAR_M - NEAREST_M) / CELL_M).max(0.0) as usize;
        let stands = |step: usize| {
            let at = sensor + ray * ((NEAREST_M + step as f64 * CELL_M) / range_m);
            let (hits, views) = (self.hits(cell_at(&at)), self.views(&at));
            let share =
                f64::from((hits & views).count_ones()) / f64::from(views.count_ones().max(1));
            share >= STANDING_SHARE
        };
        (0..steps).any(stands)
    }

    /// Forgets all scans.
    pub fn clear(&mut self) {
        self.cells.fill(Cell::default());
        self.sensors.clear();
        self.scan = 0;
    }
}

fn cell_at(place: &Point2<f64>) -> [i32; 2] {
    [place.x, place.y].map(|metres| (metres / CELL_M).floor() as i32)
}

fn index([x, y]: [i32; 2]) -> usize {
    (x.rem_euclid(SIDE) * SIDE + y.rem_euclid(SIDE)) as usize
}

fn mask(scans: u32) -> u32 {
    u32::MAX >> (32 - scans)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f64, y: f64) -> Return {
        let place = Point2::new(x, y);
        Return {
            at: place,
            direction: place.coords.normalize(),
            range_m: place.coords.norm(),
            time_s: 0.0,
            doppler_s: 0.0,
            weight: 1.0,
        }
    }

    #[test]
    fn a_place_has_the_views_and_hits_of_the_remembered_scans() {
        let mut evidence = Evidence::new(8, 70.0, 0.01);
        let (wall, car) = (at(20.0, 3.0), at(-15.0, 8.0));
        // The last three scans do not count.
        for scan in 0..12 {
            let seen = [wall, car];
            let seen = &seen[..if scan == 6 { 2 } else { 1 }];
            evidence.add(Point2::origin(), seen.iter());
        }
        assert_eq!(evidence.history(&wall), History { views: 5, hits: 5 });
        assert_eq!(evidence.history(&car), History { views: 5, hits: 1 });
        assert_eq!(
            evidence.history(&at(20.0, -9.0)),
            History { views: 5, hits: 0 }
        );
        assert_eq!(
            evidence.history(&at(80.0, 0.0)),
            History { views: 0, hits: 0 }
        );
        // Across the beam a return may lie two standard deviations beside the place.
        let beside = wall.at + Vector2::new(-3.0, 20.0).normalize() * 0.6;
        assert_eq!(evidence.history(&at(beside.x, beside.y)).hits, 5);
        evidence.clear();
        assert_eq!(evidence.history(&wall), History { views: 0, hits: 0 });
    }

    #[test]
    fn a_cell_that_stands_for_another_place_after_a_way_of_256_m_has_no_hits() {
        let mut evidence = Evidence::new(8, 70.0, 0.01);
        evidence.add(Point2::origin(), [at(20.0, 3.0)].iter());
        let far = Return {
            range_m: 20.0,
            ..at(276.0, 3.0)
        };
        assert_eq!(index(cell_at(&far.at)), index(cell_at(&at(20.0, 3.0).at)));
        assert_eq!(evidence.history(&far).hits, 0);
    }

    #[test]
    fn a_wall_stands_between_the_sensor_and_what_is_behind_it() {
        let mut evidence = Evidence::new(8, 70.0, 0.01);
        for _ in 0..8 {
            evidence.add(Point2::origin(), [at(20.25, 0.25)].iter());
        }
        let is_behind = |x| evidence.is_behind_standing(&Point2::origin(), &Point2::new(x, 0.2));
        assert!(is_behind(40.0) && !is_behind(18.0) && !is_behind(22.0));
    }
}
