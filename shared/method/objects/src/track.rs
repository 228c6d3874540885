use gyre_contract::Object;
use gyre_geometry::wrap_angle;
use nalgebra::{Matrix2, Point2, Vector2};

use crate::detector::Detection;
use crate::filter::{Filter, mahalanobis};
use crate::object::Outline;

/// Speed of a vehicle's centre across its heading, m/s: it has its place by the rear axle.
const SLIP_MPS: f64 = 0.1;
/// Standard deviation of an unmeasured velocity, m/s: the speed of any vehicle.
const UNKNOWN_MPS: f64 = 30.0;

/// Factor of the standard deviation that the network gives of a velocity: five of six scans that it
/// sees are those that it saw before, and so is most of the error.
const VELOCITY_SIGMAS: f64 = 2.0;
/// Standard deviation of the heading that the network gives, rad.
const HEADING_SIGMA_RAD: f64 = 0.2;
/// Gate on the squared Mahalanobis distance, by place and velocity, between a detection and a
/// prediction of the same object: wider than its own noise, so that it contains an object that
/// brakes hard or turns off.
const GATE: f64 = 50.0;
/// Likelihood where the network is as often wrong as right: it was trained to miss rather than
/// to invent.
const EVEN_LIKELY: f64 = 0.35;
/// Least score of a track that becomes an object: the sum of the log-likelihood ratios of an object
/// to no object.
const CONFIRM_SCORE: f64 = 1.0;
/// The largest score, so that an object that has gone ends soon.
const MAX_SCORE: f64 = 4.0;
/// The least score of a reported object that a scan shows.
const KEEP_SCORE: f64 = 0.0;
const END_SCORE: f64 = -2.0;
const MISSED_LOSS: f64 = 1.0;
const BIRTH_HITS: u32 = 2;
/// Time that a track is continued without being seen, s: a car that passes hides another for about
/// one.
const COAST_S: f64 = 1.0;
/// Time for which an object that is not seen keeps its identity, s: then it may be anywhere.
const LOST_S: f64 = 8.0;
/// The same of one that had stopped, s: a red light.
const STOPPED_S: f64 = 60.0;
/// Speed below which an object that is lost has stopped, m/s.
const STOPPING_MPS: f64 = 2.0;
/// A slower object counts as standing, m/s: odometry has errors, and wind moves things.
const STANDING_MPS: f64 = 0.8;
/// Speed above which its direction is the heading, m/s: below, noise turns it.
const HEADING_MPS: f64 = 1.0;
/// A moving object must exceed the standing speed by this many standard deviations.
const MOVING_SIGMAS: f64 = 1.0;

/// A vehicle that may be there: its filter, score and identity.
#[derive(Clone, Debug)]
pub(crate) struct Track {
    filter: Filter,
    heading: Vector2<f64>,
    /// Length and width, m: the mean over detections, weighted by their likelihood.
    size_m: [f64; 2],
    weight: f64,
    /// Identity of an object that was moving once; before it has none.
    pub id: Option<u64>,
    /// Scans since it was first seen, that one included, and those that showed it.
    age: u32,
    hits: u32,
    /// Time since it was first seen, and since it was last seen, s.
    known_s: f64,
    unseen_s: f64,
    moving: bool,
    /// True if the object is neither seen nor expected any more, or a different track has replaced
    /// it, and if it was about to stand then: the network finds moving objects only.
    pub lost: bool,
    stopped: bool,
    /// Logarithm of the likelihood ratio of an object to clutter.
    score: f64,
}

impl Track {
    pub fn new(detection: &Detection) -> Self {
        let mut filter = Filter::new(detection, UNKNOWN_MPS);
        measure_velocity(&mut filter, detection);
        Self {
            filter,
            heading: detection.heading,
            size_m: detection.size_m,
            weight: detection.likely,
            id: None,
            age: 1,
            hits: 1,
            known_s: 0.0,
            unseen_s: 0.0,
            moving: false,
            lost: false,
            stopped: false,
            score: evidence(detection),
        }
    }

    pub fn predict(&mut self, dt_s: f64) {
        if !self.stopped {
            self.filter.predict(dt_s, &self.heading);
            self.turn();
        }
        self.age = self.age.saturating_add(1);
        self.known_s += dt_s;
        self.unseen_s += dt_s;
        self.moving = false;
    }

    /// Returns the cost of assigning a detection to the track; `None` outside of its gate.
    pub fn cost(&self, detection: &Detection) -> Option<f64> {
        let place = self.filter.innovation(detection);
        let variance = (detection.sigma_mps * VELOCITY_SIGMAS).powi(2);
        let covariance = self.filter.velocity_covariance() + Matrix2::identity() * variance;
        let faster = detection.velocity - self.filter.velocity();
        let chi_square = mahalanobis(faster, covariance);
        let spread = covariance.determinant().max(f64::MIN_POSITIVE).ln();
        let cost = place.cost() + chi_square + spread;
        (place.chi_square() + chi_square <= GATE).then_some(cost)
    }

    pub fn update(&mut self, detection: &Detection) {
        self.filter.update(detection);
        measure_velocity(&mut self.filter, detection);
        let speed_mps = self.filter.velocity().norm();
        let sigma_mps = SLIP_MPS + HEADING_SIGMA_RAD * speed_mps;
        self.filter.align(&detection.heading, sigma_mps);
        // What hardly moves shows its axis, but not which end is ahead. What moves is turned into
        // its direction.
        self.heading = detection.heading * detection.heading.dot(&self.heading).signum();
        self.turn();
        self.weight += detection.likely;
        let share = detection.likely / self.weight;
        for (size_m, seen_m) in self.size_m.iter_mut().zip(detection.size_m) {
            *size_m += share * (seen_m - *size_m);
        }
        self.score = (self.score + evidence(detection)).min(MAX_SCORE);
        self.hits = self.hits.saturating_add(1);
        self.unseen_s = 0.0;
        self.judge_sight();
    }

    pub fn miss(&mut self) {
        self.score -= MISSED_LOSS;
        self.judge_sight();
    }

    fn judge_sight(&mut self) {
        if self.unseen_s > COAST_S || self.score < END_SCORE {
            self.lose();
        }
    }

    /// Makes it lost: what may be seen again, or has given way to a track of the same vehicle.
    pub fn lose(&mut self) {
        self.lost = true;
        self.stopped = self.filter.velocity().norm() < STOPPING_MPS;
    }

    fn turn(&mut self) {
        let velocity = self.filter.velocity();
        if velocity.norm() > HEADING_MPS {
            self.heading = velocity.normalize();
        }
    }

    pub fn is_object(&self) -> bool {
        self.id.is_some()
    }

    /// Returns whether it has come to its end. An object keeps its identity for longer.
    pub fn is_over(&self) -> bool {
        let kept_s = match self.stopped {
            true => STOPPED_S,
            false => LOST_S,
        };
        self.lost && (!self.is_object() || self.unseen_s > kept_s)
    }

    /// Returns how far from where a lost object would be now a track is that has become an object,
    /// or from where one that stopped would have begun to drive; `None` if it is a different
    /// object, for example one that was detected before this one was lost.
    pub fn distance(&self, found: &Self) -> Option<f64> {
        let is_along = !self.stopped || self.heading.dot(&found.heading) > 0.0;
        let may_be = self.is_object() && self.lost && found.known_s < self.unseen_s && is_along;
        let chi_square = match self.stopped {
            true => self.filter.apart_from_start(&found.filter),
            false => self.filter.apart(&found.filter),
        };
        (may_be && chi_square <= GATE).then_some(chi_square)
    }

    /// Decides whether it moves: whether its speed exceeds a standing object's by more than its
    /// uncertainty explains. Returns whether it becomes an object by that.
    pub fn judge(&mut self) -> bool {
        let (speed_mps, sigma_mps) = self.filter.speed();
        self.moving = speed_mps - STANDING_MPS > MOVING_SIGMAS * sigma_mps;
        self.moving
            && !self.is_object()
            && !self.lost
            && self.hits >= BIRTH_HITS
            && self.score >= CONFIRM_SCORE
    }

    /// Makes it the object that another track has lost, which ends.
    pub fn take_over(&mut self, lost: &mut Self) {
        self.id = lost.id.take();
        self.age = lost.age;
        let share = lost.weight / (lost.weight + self.weight);
        for (size_m, lost_m) in self.size_m.iter_mut().zip(lost.size_m) {
            *size_m += share * (lost_m - *size_m);
        }
        self.weight += lost.weight;
    }

    /// Returns whether another track is of the same vehicle: no two are at one place, but the
    /// outlines of two that meet may overlap, as their places are not exact.
    pub fn is_same(&self, other: &Self) -> bool {
        let [one, two] = [self, other].map(|track| track.filter.velocity());
        let is_slow = one.norm().min(two.norm()) < HEADING_MPS;
        (is_slow || one.dot(&two) > 0.0) && self.outline().overlaps(&other.outline())
    }

    fn outline(&self) -> Outline {
        Outline {
            centre: self.position(),
            heading: self.heading,
            size_m: self.size_m,
        }
    }

    fn position(&self) -> Point2<f64> {
        self.filter.position()
    }

    /// Returns the object, if it is one that is seen, or has been seen well until a moment ago: one
    /// that may have gone elsewhere keeps its identity in case that it is seen again.
    pub fn object(&self) -> Option<Object> {
        let is_seen = self.unseen_s == 0.0 && self.score >= KEEP_SCORE;
        let is_there = is_seen || self.score >= CONFIRM_SCORE;
        let id = self.id.filter(|_| is_there && !self.lost)?;
        let (at, velocity) = (self.position(), self.filter.velocity());
        let [length_m, width_m] = self.size_m;
        Some(Object {
            id,
            x_m: at.x,
            y_m: at.y,
            yaw_rad: wrap_angle(self.heading.y.atan2(self.heading.x)),
            vx_mps: velocity.x,
            vy_mps: velocity.y,
            length_m,
            width_m,
            position_covariance: packed(&self.filter.position_covariance()),
            velocity_covariance: packed(&self.filter.velocity_covariance()),
            moving: self.moving.into(),
            age: self.age,
        })
    }
}

/// Returns xx, xy and yy.
fn packed(matrix: &Matrix2<f64>) -> [f64; 3] {
    [matrix.m11, matrix.m12, matrix.m22]
}

fn measure_velocity(filter: &mut Filter, detection: &Detection) {
    let sigma_mps = detection.sigma_mps * VELOCITY_SIGMAS;
    for axis in [Vector2::x(), Vector2::y()] {
        filter.measure(&axis, detection.velocity.dot(&axis), sigma_mps);
    }
}

/// Returns the log-likelihood ratio of an object to no object, given a detection.
fn evidence(detection: &Detection) -> f64 {
    let odds = |likely: f64| {
        let likely = likely.clamp(1e-3, 1.0 - 1e-3);
        (likely / (1.0 - likely)).ln()
    };
    odds(detection.likely) - odds(EVEN_LIKELY)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn detection(at: [f64; 2], velocity: [f64; 2]) -> Detection {
        let velocity = Vector2::from(velocity);
        Detection {
            at: at.into(),
            velocity,
            heading: velocity.normalize(),
            size_m: [4.5, 1.9],
            likely: 0.9,
            sigma_m: 0.3,
            sigma_mps: 1.0,
            by_velocity: Matrix2::identity() * 0.1,
        }
    }

    fn seen(times: u32) -> Track {
        let mut track = Track::new(&detection([20.0, 3.0], [-10.0, 0.0]));
        for scan in 1..times {
            track.predict(0.25);
            let x = 20.0 - 2.5 * f64::from(scan);
            track.update(&detection([x, 3.0], [-10.0, 0.0]));
        }
        track
    }

    #[test]
    fn a_track_is_where_the_vehicle_was_at_the_time_of_the_scan_and_becomes_an_object() {
        let mut track = seen(1);
        assert!((track.position() - Point2::new(21.0, 3.0)).norm() < 0.05);
        assert!(!track.judge());
        let mut track = seen(3);
        assert!((track.position() - Point2::new(16.0, 3.0)).norm() < 0.05);
        assert!(track.judge());
        track.id = Some(7);
        let object = track.object().expect("it is one");
        assert!(object.id == 7 && object.is_moving() && object.age == 3);
    }

    #[test]
    fn what_drives_the_other_way_at_the_same_place_is_not_its_own() {
        let mut track = seen(4);
        track.predict(0.25);
        assert!(track.cost(&detection([10.0, 3.0], [-9.0, 0.0])).is_some());
        let other = detection([12.0, 3.0], [10.0, 0.0]);
        assert_eq!(track.cost(&other), None);
    }

    #[test]
    fn tracks_of_one_vehicle_are_in_one_lane_and_less_than_its_length_apart() {
        let track = |x: f64, y: f64| Track::new(&detection([x, y], [-10.0, 0.0]));
        let oncoming = |mps: f64| Track::new(&detection([22.0, 3.5], [mps, 0.1]));
        let first = track(20.0, 3.0);
        assert!(first.is_same(&track(24.0, 3.5)));
        assert!(!first.is_same(&track(25.0, 3.0)));
        assert!(!first.is_same(&track(20.0, 5.5)));
        assert!(!first.is_same(&oncoming(8.0)));
        // The direction of what hardly moves is noise.
        assert!(first.is_same(&oncoming(0.2)));
    }

    #[test]
    fn what_stops_keeps_its_heading_though_it_looks_the_same_from_both_ends() {
        let mut track = seen(4);
        for _ in 0..12 {
            track.predict(0.25);
            let mut standing = detection([12.0, 3.0], [-0.1, 0.0]);
            standing.heading = Vector2::new(1.0, 0.05).normalize();
            track.update(&standing);
        }
        assert!(track.filter.velocity().norm() < HEADING_MPS);
        assert!(track.heading.x < -0.99 && track.heading.y < 0.0);
    }

    #[test]
    fn a_lost_object_is_what_begins_where_it_would_be_and_nothing_that_was_beside_it() {
        let mut lost = seen(4);
        lost.id = Some(1);
        for _ in 0..8 {
            lost.predict(0.25);
            lost.miss();
        }
        assert!(lost.lost && !lost.is_over());
        assert_eq!(lost.object(), None);
        let begun = |known_s: f64, x: f64| Track {
            known_s,
            ..Track::new(&detection([x, 3.0], [-10.0, 0.0]))
        };
        // It is 20 m on, at 13.5 - 20 m.
        assert!(lost.distance(&begun(0.5, -7.5)).is_some());
        assert_eq!(lost.distance(&begun(0.5, 60.0)), None);
        assert_eq!(lost.distance(&begun(3.0, -7.5)), None);
        let mut found = begun(0.5, -7.5);
        found.take_over(&mut lost);
        assert!(found.id == Some(1) && found.age == 12);
        assert!(lost.is_over() && !found.is_over());
        lost.score = MAX_SCORE;
        assert!(!lost.judge(), "it becomes none again");
    }

    #[test]
    fn what_gave_way_keeps_its_identity_if_it_has_one() {
        let mut track = seen(4);
        track.lose();
        assert!(track.is_over());
        track.id = Some(1);
        assert!(!track.is_over() && track.object().is_none());
        track.predict(0.5);
        let begun = Track::new(&detection([8.5, 3.0], [-10.0, 0.0]));
        assert!(track.distance(&begun).is_some());
    }

    #[test]
    fn an_object_that_stopped_is_what_begins_to_drive_from_there() {
        let slow = |scan: u32| detection([20.0 - 0.375 * f64::from(scan), 3.0], [-1.5, 0.0]);
        let mut stopped = Track::new(&slow(0));
        stopped.id = Some(1);
        for scan in 1..12 {
            stopped.predict(0.25);
            stopped.update(&slow(scan));
        }
        for _ in 0..60 {
            stopped.predict(0.25);
            stopped.miss();
        }
        assert!(stopped.lost && !stopped.is_over());
        let place = stopped.position();
        let begun = |ahead_m: f64, velocity: [f64; 2]| {
            let at = [place.x - ahead_m, place.y];
            let mut begun = Track::new(&detection(at, velocity));
            begun.known_s = 0.5;
            stopped.distance(&begun).is_some()
        };
        // 4 m/s are reached after 5 m.
        assert!(begun(5.0, [-4.0, 0.0]) && begun(2.0, [-4.0, 0.0]) && begun(0.5, [-1.5, 0.0]));
        assert!(!begun(-5.0, [-4.0, 0.0]) && !begun(40.0, [-4.0, 0.0]));
        assert!(!begun(5.0, [4.0, 0.0]));
    }
}
