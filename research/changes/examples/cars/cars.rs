//! Parked cars that have come or gone.

use gyre_changes::{Change, ChangeKind};
use gyre_geometry::Pose;
use gyre_worlds::town::ParkedCar;
use nalgebra::{Point2, Vector2};

use crate::Pair;

/// Strongest echo of a car that is seen, counts: the threshold of the masks.
const SEEN_COUNTS: f64 = 60.0;
/// A place is within sight if both drives have so many scans within this range of it, m, in which a
/// car there is or would be seen.
const SIGHT_SCANS: usize = 5;
pub const SIGHT_M: f64 = 40.0;
/// Two cars whose centres are nearer than this are at one place, m.
const SAME_M: f64 = 1.0;
/// A change is that of a car if the centre of one is within the outline of the other, or so far
/// from it, m.
const BESIDE_M: f64 = 1.0;

/// A parked car of one of the drives.
pub struct Car<'a> {
    pub car: &'a ParkedCar,
    pub kind: ChangeKind,
    /// True if both drives have the place in sight.
    pub is_in_sight: bool,
    /// The least distance of the place from their paths.
    pub away_m: f64,
}

impl Pair {
    /// The parked cars of one drive where the other one has none.
    pub fn changed_cars(&self) -> Vec<Car<'_>> {
        let kinds = [ChangeKind::Gone, ChangeKind::Appeared];
        let mut cars = Vec::new();
        for (which, kind) in kinds.into_iter().enumerate() {
            let others = self.drives[1 - which].parked_cars();
            for car in self.drives[which].parked_cars() {
                let apart_m = |other: &ParkedCar| {
                    (other.pose.translation.vector - car.pose.translation.vector).norm()
                };
                if others.iter().all(|other| apart_m(other) > SAME_M) {
                    cars.push(self.seen(car, kind));
                }
            }
        }
        cars
    }

    /// A car with what both drives could see of it.
    fn seen<'a>(&self, car: &'a ParkedCar, kind: ChangeKind) -> Car<'a> {
        let mut away_m = f64::INFINITY;
        let is_in_sight = self.drives.each_ref().map(|drive| {
            let place = car.pose.translation.vector;
            let range_m = |scan: usize| (drive.pose(scan).translation.vector - place).norm();
            let near = (0..drive.scans()).filter(|scan| range_m(*scan) <= SIGHT_M);
            let near: Vec<usize> = near.collect();
            away_m = near
                .iter()
                .map(|scan| range_m(*scan))
                .fold(away_m, f64::min);
            let is_seen = |scan: &&usize| drive.parked_counts(car, **scan) >= SEEN_COUNTS;
            near.iter().filter(is_seen).count() >= SIGHT_SCANS
        });
        Car {
            car,
            kind,
            is_in_sight: is_in_sight == [true; 2],
            away_m,
        }
    }
}

impl Car<'_> {
    pub fn centre(&self) -> Point2<f64> {
        Point2::from(self.car.pose.translation.vector)
    }

    /// Returns whether a change is that of this car.
    pub fn is(&self, change: &Change) -> bool {
        let of_change = Pose::new(Vector2::new(change.x_m, change.y_m), change.yaw_rad);
        let of_car = self.car.pose;
        self.kind == change.kind
            && (is_within(
                &of_change,
                [change.length_m, change.width_m],
                &self.centre(),
            ) || is_within(&of_car, self.car.size_m(), &centre(change)))
    }
}

pub fn centre(change: &Change) -> Point2<f64> {
    Point2::new(change.x_m, change.y_m)
}

/// Returns whether a place is in a rectangle or just beside it.
fn is_within(pose: &Pose, [length_m, width_m]: [f64; 2], place: &Point2<f64>) -> bool {
    let at = pose.inverse() * place;
    at.x.abs() <= 0.5 * length_m + BESIDE_M && at.y.abs() <= 0.5 * width_m + BESIDE_M
}
