//! Tracked objects against true ones: CLEAR MOT (Bernardin and Stiefelhagen, "Evaluating multiple
//! object tracking performance", 2008) and the errors of position, velocity and heading.
//!
//! A scan's objects are compared in the frame of its sensor. Those that a tracker must have are
//! *required*: vehicles that move, are near and have been seen in some scans. An object that
//! matches one that is there but not required, as a pedestrian, counts neither for nor against.

use std::{
    collections::{BTreeMap, BTreeSet},
    fmt,
    ops::Range,
};

use gyre_objects::assign;
use nalgebra::{Matrix2, Point2, Vector2};
use serde::Serialize;

mod bands;
mod hota;

pub use bands::ObjectBand;
pub use hota::Hota;

use bands::{ALL, RANGES_M, SPEEDS_MPS, Sums};
use hota::Compared;

/// A true object at the time of a scan, in the frame of the sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrueObject {
    pub id: u64,
    /// Centre, m.
    pub position: Point2<f64>,
    /// Velocity over ground, m/s; `None` if it is not known.
    pub velocity: Option<Vector2<f64>>,
    pub yaw_rad: f64,
    /// True for motor vehicles, which a tracker must find.
    pub is_vehicle: bool,
    /// True if the sensor can see it in this scan.
    pub is_seen: bool,
}

/// A tracked object at the time of a scan, in the frame of the sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackedObject {
    pub id: u64,
    pub position: Point2<f64>,
    /// Velocity over ground, m/s.
    pub velocity: Vector2<f64>,
    pub velocity_covariance: Matrix2<f64>,
    pub yaw_rad: f64,
    /// True if it is reported as moving. The others are not judged.
    pub moving: bool,
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct ObjectScan {
    pub truth: Vec<TrueObject>,
    pub tracked: Vec<TrackedObject>,
}

/// The largest range of a required object, m.
const MAX_RANGE_M: f64 = 60.0;
/// Lowest speed of a required object, m/s.
const MIN_SPEED_MPS: f64 = 2.0;
/// Scans within that range that have shown a required object, including the present one.
const MIN_SCANS: usize = 3;
/// Largest distance between the centres of a pair, m: the length of a car.
const GATE_M: f64 = 4.0;

#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ObjectErrors {
    pub scans: usize,
    pub objects: usize,
    pub required: usize,
    pub matched: usize,
    /// Tracked objects that move, once for each scan, where nothing is.
    pub false_positives: usize,
    /// Times that a required object is matched by another identity than before.
    pub switches: usize,
    /// Share of the required ones that were matched.
    pub recall: f64,
    /// Share of the tracked ones that were matched.
    pub precision: f64,
    /// 1 less misses, false positives and switches over the required ones.
    pub mota: f64,
    /// Detection and association in one figure, and each.
    #[serde(flatten)]
    pub hota: Hota,
    pub switches_per_object: f64,
    pub position_rmse_m: f64,
    /// Root mean square of the difference of the velocities, m/s; over pairs whose true velocity is
    /// known, as the next two.
    pub velocity_rmse_mps: f64,
    pub heading_rmse_deg: f64,
    /// Mean of the squared error of the velocity by its covariance, over its two dimensions: 1 if
    /// the covariance is right.
    pub velocity_nees: f64,
    pub by_range: Vec<ObjectBand>,
    pub by_speed: Vec<ObjectBand>,
}

impl fmt::Display for ObjectErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (objects, scans, hota) = (self.objects, self.scans, &self.hota);
        let (matched, required) = (self.matched, self.required);
        let (recall, precision) = (100.0 * self.recall, 100.0 * self.precision);
        let (wrong, mota) = (self.false_positives, self.mota);
        let (switches, each) = (self.switches, self.switches_per_object);
        let (position, velocity) = (self.position_rmse_m, self.velocity_rmse_mps);
        let (heading, nees) = (self.heading_rmse_deg, self.velocity_nees);
        write!(
            f,
            "objects       {objects} in {scans} scans, {matched} of {required} matched\n\
             recall        {recall:.1} %\n\
             precision     {precision:.1} %, {wrong} false\n\
             MOTA          {mota:.3}\n\
             HOTA          {hota}\n\
             ID switches   {switches}, {each:.3} an object\n\
             position      {position:.2} m RMSE\n\
             velocity      {velocity:.2} m/s RMSE\n\
             heading       {heading:.1} deg RMSE\n\
             velocity NEES {nees:.2}"
        )?;
        for (bands, unit) in [(&self.by_range, "m"), (&self.by_speed, "m/s")] {
            for band in bands {
                write!(f, "\n{}", band.line(unit))?;
            }
        }
        Ok(())
    }
}

pub fn object_errors(scans: &[ObjectScan]) -> ObjectErrors {
    errors_from_scan(MIN_SCANS, scans)
}

/// Returns the errors where an object is required from its scan of this number on.
fn errors_from_scan(min_scans: usize, scans: &[ObjectScan]) -> ObjectErrors {
    let mut count = Count::default();
    for scan in scans {
        count.add(scan, min_scans);
    }
    count.errors(scans.len())
}

#[derive(Default)]
struct Count {
    /// Scans that show each true object within the range.
    seen: BTreeMap<u64, usize>,
    matches: BTreeMap<u64, u64>,
    objects: BTreeSet<u64>,
    switches: usize,
    all: Sums,
    by_range: [Sums; RANGES_M.len()],
    by_speed: [Sums; SPEEDS_MPS.len()],
    compared: Vec<Compared>,
}

impl Count {
    fn add(&mut self, scan: &ObjectScan, min_scans: usize) {
        let (required, others) = self.split(scan, min_scans);
        let tracked = scan.tracked.iter().filter(|tracked| tracked.moving);
        let tracked: Vec<TrackedObject> = tracked.copied().collect();
        let pairs = self.pairs(&required, &tracked);
        let found_as = |truth: usize| {
            let pair = pairs.iter().find(|pair| pair.0 == truth)?;
            Some(&tracked[pair.1])
        };
        for (index, truth) in required.iter().enumerate() {
            self.add_required(truth, found_as(index));
        }
        let is_excused = |tracked: &TrackedObject| {
            let near = |other: &TrueObject| distance_m(other, tracked) <= GATE_M;
            range_m(&tracked.position) > MAX_RANGE_M || others.iter().any(near)
        };
        let is_matched = |found: usize| pairs.iter().any(|pair| pair.1 == found);
        let (matched, rest): (Vec<usize>, Vec<usize>) =
            (0..tracked.len()).partition(|found| is_matched(*found));
        let is_false = |found: &usize| !is_excused(&tracked[*found]);
        let wrong: Vec<usize> = rest.into_iter().filter(is_false).collect();
        for found in &wrong {
            self.add_false(&tracked[*found]);
        }
        let judged = matched.iter().chain(&wrong).map(|found| &tracked[*found]);
        let judged: Vec<&TrackedObject> = judged.collect();
        self.compared
            .push(Compared::new(&required, &judged, GATE_M));
    }

    fn split(&mut self, scan: &ObjectScan, min_scans: usize) -> (Vec<TrueObject>, Vec<TrueObject>) {
        let is_required = |truth: &TrueObject| {
            let is_near = range_m(&truth.position) <= MAX_RANGE_M;
            let seen = self.seen.entry(truth.id).or_default();
            *seen += usize::from(is_near && truth.is_seen);
            let speed_mps = truth.velocity.map_or(f64::INFINITY, |it| it.norm());
            is_near
                && truth.is_seen
                && truth.is_vehicle
                && speed_mps > MIN_SPEED_MPS
                && *seen >= min_scans
        };
        scan.truth.iter().copied().partition(is_required)
    }

    /// Pairs true and tracked objects, by their places in the lists: those that were a pair before
    /// and still fit, then the rest, so that as many as possible fit and the distances are least.
    fn pairs(&self, truth: &[TrueObject], tracked: &[TrackedObject]) -> Vec<(usize, usize)> {
        let within = |t: usize, f: usize| {
            let distance_m = distance_m(&truth[t], &tracked[f]);
            (distance_m <= GATE_M).then_some(distance_m)
        };
        let kept = |t: usize| {
            let id = self.matches.get(&truth[t].id)?;
            let found = tracked.iter().position(|tracked| tracked.id == *id)?;
            within(t, found).map(|_| (t, found))
        };
        let mut pairs: Vec<(usize, usize)> = Vec::new();
        for pair in (0..truth.len()).filter_map(kept) {
            if pairs.iter().all(|other| other.1 != pair.1) {
                pairs.push(pair);
            }
        }
        let free = |count: usize, of: &dyn Fn(&(usize, usize)) -> usize| -> Vec<usize> {
            let is_free = |index: &usize| pairs.iter().all(|pair| of(pair) != *index);
            (0..count).filter(is_free).collect()
        };
        let (rows, columns) = (free(truth.len(), &|p| p.0), free(tracked.len(), &|p| p.1));
        let costs = |t: &usize| columns.iter().map(|f| within(*t, *f)).collect();
        let costs: Vec<Vec<Option<f64>>> = rows.iter().map(costs).collect();
        for (row, column) in assign(&costs).into_iter().enumerate() {
            pairs.extend(column.map(|column| (rows[row], columns[column])));
        }
        pairs
    }

    fn add_required(&mut self, truth: &TrueObject, found: Option<&TrackedObject>) {
        self.objects.insert(truth.id);
        if let Some(found) = found {
            let before = self.matches.insert(truth.id, found.id);
            self.switches += usize::from(before.is_some_and(|id| id != found.id));
        }
        let speed_mps = truth.velocity.map(|velocity| velocity.norm());
        for sums in self.sums_of(range_m(&truth.position), speed_mps) {
            sums.add(truth, found);
        }
    }

    fn add_false(&mut self, found: &TrackedObject) {
        let (range_m, speed_mps) = (range_m(&found.position), found.velocity.norm());
        for sums in self.sums_of(range_m, Some(speed_mps)) {
            sums.false_positives += 1;
        }
    }

    fn sums_of(&mut self, range_m: f64, speed_mps: Option<f64>) -> impl Iterator<Item = &mut Sums> {
        let by_range = RANGES_M.iter().position(|band| band.contains(&range_m));
        let speed_of = |mps: f64| SPEEDS_MPS.iter().position(|band| band.contains(&mps));
        let by_speed = speed_mps.and_then(speed_of);
        std::iter::once(&mut self.all)
            .chain(by_range.map(|band| &mut self.by_range[band]))
            .chain(by_speed.map(|band| &mut self.by_speed[band]))
    }

    fn errors(&self, scans: usize) -> ObjectErrors {
        let (sums, all) = (&self.all, self.all.in_band(&ALL));
        let (required, matched) = (sums.required, sums.matched);
        let false_positives = sums.false_positives;
        let wrong = required - matched + false_positives + self.switches;
        let by = |bands: &[Range<f64>], sums: &[Sums]| -> Vec<ObjectBand> {
            let both = bands.iter().zip(sums);
            both.map(|(band, sums)| sums.in_band(band)).collect()
        };
        ObjectErrors {
            scans,
            objects: self.objects.len(),
            required,
            matched,
            false_positives,
            switches: self.switches,
            recall: all.recall,
            precision: all.precision,
            mota: 1.0 - share(wrong as f64, required),
            hota: Hota::of(&self.compared),
            switches_per_object: share(self.switches as f64, self.objects.len()),
            position_rmse_m: all.position_rmse_m,
            velocity_rmse_mps: all.velocity_rmse_mps,
            heading_rmse_deg: all.heading_rmse_deg,
            velocity_nees: sums.velocity_nees(),
            by_range: by(&RANGES_M, &self.by_range),
            by_speed: by(&SPEEDS_MPS, &self.by_speed),
        }
    }
}

/// Returns a part of a whole; 0 of nothing.
fn share(part: f64, whole: usize) -> f64 {
    part / whole.max(1) as f64
}

fn range_m(position: &Point2<f64>) -> f64 {
    position.coords.norm()
}

fn distance_m(truth: &TrueObject, tracked: &TrackedObject) -> f64 {
    (truth.position - tracked.position).norm()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn truth(id: u64, x: f64) -> TrueObject {
        TrueObject {
            id,
            position: Point2::new(x, 0.0),
            velocity: Some(Vector2::new(10.0, 0.0)),
            yaw_rad: 0.0,
            is_vehicle: true,
            is_seen: true,
        }
    }

    fn tracked(id: u64, x: f64) -> TrackedObject {
        TrackedObject {
            id,
            position: Point2::new(x, 0.0),
            velocity: Vector2::new(9.0, 0.0),
            velocity_covariance: Matrix2::identity(),
            yaw_rad: 0.1,
            moving: true,
        }
    }

    fn scan(truth: &[TrueObject], tracked: &[TrackedObject]) -> ObjectScan {
        ObjectScan {
            truth: truth.to_vec(),
            tracked: tracked.to_vec(),
        }
    }

    /// The errors where each object is required from its first scan on.
    fn at_once(scans: &[ObjectScan]) -> ObjectErrors {
        errors_from_scan(1, scans)
    }

    #[test]
    fn an_object_is_required_from_its_third_scan_on() {
        let scans = vec![scan(&[truth(1, 20.0)], &[]); 5];
        let errors = object_errors(&scans);
        assert_eq!((errors.objects, errors.required, errors.matched), (1, 3, 0));
        let hidden = TrueObject {
            is_seen: false,
            ..truth(1, 20.0)
        };
        let scans = vec![scan(&[hidden], &[]); 5];
        assert_eq!(object_errors(&scans).required, 0);
    }

    #[test]
    fn a_pair_is_kept_while_it_fits_and_another_identity_is_a_switch() {
        let scans = [
            scan(&[truth(1, 20.0)], &[tracked(5, 21.0)]),
            // A nearer one comes, and is false as long as the first one fits.
            scan(&[truth(1, 20.0)], &[tracked(5, 21.0), tracked(6, 20.0)]),
            scan(&[truth(1, 20.0)], &[tracked(6, 20.0)]),
        ];
        let errors = at_once(&scans);
        let counts = (errors.matched, errors.false_positives, errors.switches);
        assert_eq!(counts, (3, 1, 1));
        assert!((errors.mota - (1.0 - 2.0 / 3.0)).abs() < 1e-12, "{errors}");
        assert!((errors.velocity_rmse_mps - 1.0).abs() < 1e-12);
        assert!((errors.velocity_nees - 0.5).abs() < 1e-12);
        assert!((errors.position_rmse_m - (2.0f64 / 3.0).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn what_is_there_but_not_required_excuses_and_what_is_far_too() {
        let walker = TrueObject {
            is_vehicle: false,
            ..truth(2, -20.0)
        };
        let found = [tracked(1, -21.0), tracked(2, 70.0), tracked(3, 20.0)];
        let errors = at_once(&[scan(&[walker], &found)]);
        assert_eq!((errors.required, errors.false_positives), (0, 1));
        let standing = TrackedObject {
            moving: false,
            ..tracked(3, 20.0)
        };
        let errors = at_once(&[scan(&[], &[standing])]);
        assert_eq!(errors.false_positives, 0);
    }
}
