//! Where the last scans saw something, and where they saw that nothing is.
//!
//! A grid that wraps around covers the surroundings of the sensor. Each cell remembers in which of
//! the last 64 scans it had a return. A place that some of these scans had in view, and that had no
//! return in them, was free. In view is what the beam reaches: up to the first strong return of its
//! direction, or beyond it up to the last return, for a radar sees over what is low and through
//! what is thin. What is hidden behind is neither free nor taken.

use std::collections::VecDeque;
use std::f64::consts::TAU;

use nalgebra::{Point2, Vector2};

use crate::returns::Return;

/// Side of a cell, m: three range cells.
const CELL_M: f64 = 0.5;
/// Cells a side: 256 m, twice the largest range and the way of the remembered scans.
const SIDE: i32 = 512;
/// Distance to the ends of what a beam reaches within which a place is not reliably in view, m.
const EDGE_M: f64 = 1.0;
/// Directions of which the reach is kept: 0.9 degrees each.
const SECTORS: usize = 400;
/// Directions to either side of a return in which it is seen: the half width of a beam.
const BEAM_SECTORS: usize = 2;
/// Weight of a return that may hide what is behind it: 9 dB above the threshold of the masks.
const HIDING_WEIGHT: f64 = 0.3;
/// Weight of a return by which the beam goes on.
const BEYOND_WEIGHT: f64 = 0.15;
/// Planes of the grid: any return; the strong ones, which stand above the reverberation of a strong
/// echo in all ranges of its azimuth; and those that may hide what is behind them.
const ANY: usize = 0;
const STRONG: usize = 1;
const HIDING: usize = 2;
/// Weight of a strong return: 4.5 dB above the threshold of the masks.
const STRONG_WEIGHT: f64 = 0.15;
/// Weight from which on a return outshines weak ones that were there before: 15 dB above those.
const OUTSHINING_WEIGHT: f64 = 0.65;
/// Scans on end that see a place empty, after which what was there has gone: of what stands and is
/// as strong as that, 15 dB above what a return needs, each scan sees four in five and more.
const EMPTY_SCANS: u32 = 4;
/// Standard deviations of the bearing within which a place may be that of a return.
const ACROSS_SIGMAS: f64 = 1.5;
/// The last scans in which a vehicle may have been at the place that it has now: one of 5 m that is
/// faster than 7 m/s. At the start of a drive, half of the scans.
const OWN_SCANS: u32 = 3;
/// Distance before an object within which what stands does not hide it, m: a car is 5 m long.
const CLEAR_M: f64 = 3.0;
/// Share of the views with a return in a cell of what stands: a firm wall returns in most scans.
const STANDING_SHARE: f64 = 0.6;
/// The views from which on that share says so: within a second a vehicle of 5 m has left its place,
/// if it is faster than 5 m/s.
const STANDING_VIEWS: u32 = 4;
/// The range below which points are not extracted, m.
const NEAREST_M: f64 = 5.0;

/// The memory of returns.
#[derive(Clone, Debug)]
pub(crate) struct Evidence {
    cells: Vec<Cell>,
    /// The last scans, the newest first.
    views: VecDeque<View>,
    memory_scans: u32,
    max_range_m: f64,
    scan: u32,
}

/// The view of a scan.
#[derive(Clone, Debug)]
struct View {
    sensor: Point2<f64>,
    /// Range up to which each direction of the odometry's frame was seen, m.
    reach_m: Vec<f64>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Cell {
    /// The place that it stands for, by its cells from the origin.
    place: [i32; 2],
    /// Bit k is set if there was a return k scans before `scan`, in each plane.
    hits: [u64; 3],
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
    /// Returns the expected share of the views with a return, for a share that is beta-distributed
    /// before anything is seen: see [`PRIOR`].
    pub fn share(&self) -> f64 {
        let [returns, views] = PRIOR;
        (f64::from(self.hits) + returns) / (f64::from(self.views) + views)
    }
}

/// Returns and views that are added to those of a place: of what has never been in view half may be
/// taken.
const PRIOR: [f64; 2] = [0.3, 0.6];

impl View {
    /// Takes the returns of a scan.
    fn new(sensor: Point2<f64>, returns: &[Return], max_range_m: f64) -> Self {
        let mut first_m = vec![max_range_m; SECTORS];
        let mut last_m = vec![0.0f64; SECTORS];
        for found in returns {
            let seen = sector(&(found.at - sensor));
            for step in 0..=2 * BEAM_SECTORS {
                let around = (seen + SECTORS + step - BEAM_SECTORS) % SECTORS;
                if found.weight >= HIDING_WEIGHT {
                    first_m[around] = first_m[around].min(found.range_m);
                }
                if found.weight >= BEYOND_WEIGHT {
                    last_m[around] = last_m[around].max(found.range_m);
                }
            }
        }
        let reach = first_m.iter().zip(&last_m);
        Self {
            sensor,
            reach_m: reach.map(|(first, last)| first.max(*last)).collect(),
        }
    }

    /// Returns whether a place was in view.
    fn sees(&self, place: &Point2<f64>) -> bool {
        let ray = place - self.sensor;
        let reach_m = self.reach_m[sector(&ray)];
        (NEAREST_M + EDGE_M..reach_m - EDGE_M).contains(&ray.norm())
    }
}

/// Returns the number of a direction.
fn sector(ray: &Vector2<f64>) -> usize {
    let turn = ray.y.atan2(ray.x).rem_euclid(TAU) / TAU;
    (turn * SECTORS as f64) as usize % SECTORS
}

impl Evidence {
    pub fn new(memory_scans: u32, max_range_m: f64) -> Self {
        Self {
            cells: vec![Cell::default(); (SIDE * SIDE) as usize],
            views: VecDeque::with_capacity(memory_scans as usize + 1),
            memory_scans,
            max_range_m,
            scan: 0,
        }
    }

    /// Returns what the scans before saw where a return is, within the standard deviation of its
    /// bearing, rad, and one cell for the rest. A return that outshines weak ones is compared with
    /// strong ones only.
    pub fn history(&self, found: &Return, bearing_sigma_rad: f64) -> History {
        let plane = match found.weight >= OUTSHINING_WEIGHT {
            true => STRONG,
            false => ANY,
        };
        let across_m = ACROSS_SIGMAS * bearing_sigma_rad * found.range_m;
        let steps = (across_m / CELL_M).ceil() as i32;
        let side = Vector2::new(-found.direction.y, found.direction.x);
        let mut hits = 0;
        for step in -steps..=steps {
            let centre = found.at + side * (f64::from(step) * across_m / f64::from(steps.max(1)));
            hits |= self.hits_around(&centre, plane);
        }
        // What came a moment ago may be the same object.
        let own = OWN_SCANS.min(self.views.len() as u32 / 2);
        let before = u64::MAX << own;
        let (mut hits, mut views) = (hits & before, self.views(&found.at) & before);
        if found.weight >= OUTSHINING_WEIGHT {
            let since = since_empty(hits, views);
            (hits, views) = (hits & since, views & since);
        }
        // A return shows that the place was in view.
        History {
            views: (views | hits).count_ones(),
            hits: hits.count_ones(),
        }
    }

    /// The scans in which a place was in view, as the bits of a cell.
    fn views(&self, place: &Point2<f64>) -> u64 {
        let views = self.views.iter().enumerate();
        views.fold(0, |bits, (ago, view)| {
            bits | (u64::from(view.sees(place)) << ago)
        })
    }

    /// The scans with a return in a cell or one beside it.
    fn hits_around(&self, place: &Point2<f64>, plane: usize) -> u64 {
        let [x, y] = cell_at(place);
        let around = (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| [x + dx, y + dy]));
        around.fold(0, |bits, place| bits | self.hits(place, plane))
    }

    /// Returns whether the newest scan that was added has a return at a place; `None` if it is
    /// not in view.
    pub fn is_occupied(&self, place: &Point2<f64>) -> Option<bool> {
        let taken = self.hits_around(place, ANY) & 1 != 0;
        let is_seen = taken || self.views.front()?.sees(place);
        is_seen.then_some(taken)
    }

    /// Bit k: a return k scans before the newest one that was added.
    fn hits(&self, place: [i32; 2], plane: usize) -> u64 {
        let cell = &self.cells[index(place)];
        let ago = self.scan.wrapping_sub(cell.scan);
        match cell.place == place && ago < self.memory_scans {
            true => cell.hits[plane] << ago & mask(self.memory_scans),
            false => 0,
        }
    }

    /// Adds a scan: its returns, and which of them do not belong to moving objects.
    pub fn add(&mut self, sensor: Point2<f64>, returns: &[Return], stands: impl Fn(usize) -> bool) {
        self.scan += 1;
        self.views
            .push_front(View::new(sensor, returns, self.max_range_m));
        self.views.truncate(self.memory_scans as usize);
        for (number, found) in returns.iter().enumerate() {
            if stands(number) {
                let place = cell_at(&found.at);
                let scan = self.scan;
                let is_in = |least| found.weight >= least;
                let planes = [true, is_in(STRONG_WEIGHT), is_in(HIDING_WEIGHT)];
                let hits = [ANY, STRONG, HIDING]
                    .map(|plane| self.hits(place, plane) | u64::from(planes[plane]));
                self.cells[index(place)] = Cell { place, hits, scan };
            }
        }
    }

    /// Returns whether something that stands and hides is on the way from the sensor to a place,
    /// and not just before it.
    pub fn is_behind_standing(&self, sensor: &Point2<f64>, place: &Point2<f64>) -> bool {
        let ray = place - sensor;
        let range_m = ray.norm();
        let steps = ((range_m - CLEAR_M - NEAREST_M) / CELL_M).max(0.0) as usize;
        let stands = |step: usize| {
            let at = sensor + ray * ((NEAREST_M + step as f64 * CELL_M) / range_m);
            let hits = self.hits(cell_at(&at), HIDING);
            let views = self.views(&at) | hits;
            let share = f64::from(hits.count_ones()) / f64::from(views.count_ones().max(1));
            share >= STANDING_SHARE && views.count_ones() >= STANDING_VIEWS
        };
        (0..steps).any(stands)
    }

    /// Returns whether something that stands is between a place and the sensor in the newest scan
    /// that was added.
    pub fn is_hidden(&self, place: &Point2<f64>) -> bool {
        let view = self.views.front();
        view.is_some_and(|view| self.is_behind_standing(&view.sensor, place))
    }

    /// Forgets all scans.
    pub fn clear(&mut self) {
        self.cells.fill(Cell::default());
        self.views.clear();
        self.scan = 0;
    }
}

/// Returns the scans since a place was last in view and empty for some scans on end, those
/// included; all if it never was.
fn since_empty(hits: u64, views: u64) -> u64 {
    let empty = views & !hits;
    let run = (1..EMPTY_SCANS).fold(empty, |run, ago| run & (empty >> ago));
    match run {
        0 => u64::MAX,
        _ => mask((run.trailing_zeros() + EMPTY_SCANS).min(64)),
    }
}

fn cell_at(place: &Point2<f64>) -> [i32; 2] {
    [place.x, place.y].map(|metres| (metres / CELL_M).floor() as i32)
}

fn index([x, y]: [i32; 2]) -> usize {
    (x.rem_euclid(SIDE) * SIDE + y.rem_euclid(SIDE)) as usize
}

fn mask(scans: u32) -> u64 {
    u64::MAX >> (64 - scans)
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
            stands_out: true,
            share: 1.0,
        }
    }

    /// The same return, too weak to outshine others.
    fn faint(found: Return) -> Return {
        Return {
            weight: 0.5,
            ..found
        }
    }

    fn add(evidence: &mut Evidence, returns: &[Return]) {
        evidence.add(Point2::origin(), returns, |_| true);
    }

    #[test]
    fn a_place_has_the_views_and_hits_of_the_remembered_scans() {
        let mut evidence = Evidence::new(8, 70.0);
        let (wall, car) = (at(20.0, 3.0), at(-15.0, 8.0));
        // The last three scans do not count.
        for scan in 0..12 {
            let seen = [wall, car];
            add(&mut evidence, &seen[..if scan == 6 { 2 } else { 1 }]);
        }
        assert_eq!(
            evidence.history(&faint(wall), 0.01),
            History { views: 5, hits: 5 }
        );
        assert_eq!(
            evidence.history(&faint(car), 0.01),
            History { views: 5, hits: 1 }
        );
        assert_eq!(
            evidence.history(&faint(at(20.0, -9.0)), 0.01),
            History { views: 5, hits: 0 }
        );
        assert_eq!(
            evidence.history(&at(80.0, 0.0), 0.01),
            History { views: 0, hits: 0 }
        );
        // Across the beam a return may lie beside the place.
        let beside = wall.at + Vector2::new(-3.0, 20.0).normalize() * 0.6;
        assert_eq!(evidence.history(&at(beside.x, beside.y), 0.01).hits, 5);
        evidence.clear();
        assert_eq!(
            evidence.history(&faint(wall), 0.01),
            History { views: 0, hits: 0 }
        );
    }

    #[test]
    fn what_an_obstacle_hides_is_not_free_and_what_is_seen_beyond_it_is() {
        let behind = |beyond: &[Return]| {
            let mut evidence = Evidence::new(8, 70.0);
            for _ in 0..8 {
                add(&mut evidence, &[&[at(20.0, 3.0)], beyond].concat());
            }
            evidence.history(&faint(at(30.0, 4.5)), 0.01).views
        };
        assert_eq!(behind(&[]), 0);
        assert_eq!(behind(&[at(50.0, 7.5)]), 5);
        assert_eq!(behind(&[at(50.0, -7.5)]), 0);
        let weak = Return {
            weight: 0.1,
            ..at(50.0, 7.5)
        };
        assert_eq!(behind(&[weak]), 0);
        let unseen = History { views: 0, hits: 0 };
        assert_eq!(unseen.share(), 0.5);
    }

    #[test]
    fn a_strong_return_outshines_the_reverberation_that_was_there_before() {
        let mut evidence = Evidence::new(8, 70.0);
        let strong = at(20.0, 3.0);
        let weak = Return {
            weight: 0.1,
            ..strong
        };
        for _ in 0..8 {
            add(&mut evidence, &[weak]);
        }
        let hits = |found: &Return| evidence.history(found, 0.01).hits;
        assert_eq!((hits(&weak), hits(&strong)), (5, 0));
        let behind = Point2::new(40.0, 6.0);
        assert!(!evidence.is_behind_standing(&Point2::origin(), &behind));
    }

    #[test]
    fn what_stands_hides_if_it_is_9_db_above_the_threshold_and_a_hedge_does_not() {
        let behind = |weight: f64| {
            let mut evidence = Evidence::new(8, 70.0);
            let standing = Return {
                weight,
                ..at(20.0, 3.0)
            };
            for _ in 0..8 {
                add(&mut evidence, &[standing]);
            }
            evidence.is_hidden(&Point2::new(40.0, 6.0))
        };
        assert!(behind(0.5));
        assert!(!behind(0.2));
    }

    #[test]
    fn a_strong_return_is_new_where_the_place_has_just_been_empty_and_a_weak_one_is_not() {
        let mut evidence = Evidence::new(20, 70.0);
        let strong = at(20.0, 3.0);
        let weak = Return {
            weight: 0.5,
            ..strong
        };
        // A vehicle stood there, and left.
        (0..12).for_each(|_| add(&mut evidence, &[strong]));
        (0..OWN_SCANS + EMPTY_SCANS - 1).for_each(|_| add(&mut evidence, &[]));
        let history = |evidence: &Evidence, found| evidence.history(found, 0.01);
        assert_eq!(history(&evidence, &strong).hits, 12);
        add(&mut evidence, &[]);
        let (views, hits) = (EMPTY_SCANS, 0);
        assert_eq!(history(&evidence, &strong), History { views, hits });
        assert_eq!(history(&evidence, &weak).hits, 12);
    }

    #[test]
    fn a_cell_that_stands_for_another_place_after_a_way_of_256_m_has_no_hits() {
        let mut evidence = Evidence::new(8, 70.0);
        add(&mut evidence, &[at(20.0, 3.0)]);
        let far = Return {
            range_m: 20.0,
            ..at(276.0, 3.0)
        };
        assert_eq!(index(cell_at(&far.at)), index(cell_at(&at(20.0, 3.0).at)));
        assert_eq!(evidence.history(&far, 0.01).hits, 0);
    }

    #[test]
    fn a_wall_stands_between_the_sensor_and_what_is_behind_it() {
        let mut evidence = Evidence::new(8, 70.0);
        for _ in 0..8 {
            add(&mut evidence, &[at(20.25, 0.25)]);
        }
        let is_behind = |evidence: &Evidence, x| {
            evidence.is_behind_standing(&Point2::origin(), &Point2::new(x, 0.2))
        };
        assert!(is_behind(&evidence, 40.0));
        assert!(!is_behind(&evidence, 18.0) && !is_behind(&evidence, 22.0));
        // In its first seconds a wall may be a vehicle.
        let mut first = Evidence::new(20, 70.0);
        (1..STANDING_VIEWS).for_each(|_| add(&mut first, &[at(20.25, 0.25)]));
        assert!(!is_behind(&first, 40.0));
        add(&mut first, &[at(20.25, 0.25)]);
        assert!(is_behind(&first, 40.0));
    }
}
