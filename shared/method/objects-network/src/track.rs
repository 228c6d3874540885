//! A track: an object from its birth to its death.

use nalgebra::{Point2, Vector2};

use crate::detector::Detection;
use crate::filter::{Filter, Sighting};
use gyre_objects::Object;

use crate::NetworkConfig;

/// Distance between the centres of two tracks of one vehicle, m: less than a car is long.
const SAME_M: f64 = 3.0;
/// Speed of a vehicle's centre across its heading, m/s: it has its place by the rear axle.
const SLIP_MPS: f64 = 0.1;

/// An object that may be one.
#[derive(Clone, Debug)]
pub(crate) struct Track {
    filter: Filter,
    heading: Vector2<f64>,
    /// Length and width, m: the mean of what was seen, weighed by how likely it was.
    size_m: [f64; 2],
    weight: f64,
    /// Identity of an object that was moving once; before it has none.
    id: Option<u64>,
    /// Scans since it was first seen, that one included, and those that showed it.
    age: u32,
    hits: u32,
    /// Time since it was first seen, and since it was last seen, s.
    known_s: f64,
    unseen_s: f64,
    moving: bool,
    /// Logarithm of the likelihood of an object over that of clutter.
    score: f64,
}

impl Track {
    /// Begins a track.
    pub fn new(detection: &Detection, config: &NetworkConfig) -> Self {
        Self {
            filter: Filter::new(&Sighting::of(detection, config)),
            heading: detection.heading,
            size_m: detection.size_m,
            weight: detection.likely,
            id: None,
            age: 1,
            hits: 1,
            known_s: 0.0,
            unseen_s: 0.0,
            moving: false,
            score: evidence(detection, config),
        }
    }

    /// Predicts it some seconds later.
    pub fn predict(&mut self, dt_s: f64, config: &NetworkConfig) {
        if !self.has_stopped(config) {
            self.filter.predict(dt_s, &self.heading, config);
            self.turn(config);
        }
        self.age = self.age.saturating_add(1);
        self.known_s += dt_s;
        self.unseen_s += dt_s;
        self.moving = false;
    }

    /// Returns what it costs that a scan shows it there; `None` outside of its gate.
    pub fn cost(&self, detection: &Detection, config: &NetworkConfig) -> Option<f64> {
        let (chi_square, cost) = self.filter.distance(&Sighting::of(detection, config));
        (chi_square <= config.gate).then_some(cost)
    }

    /// Updates it by what a scan shows.
    pub fn update(&mut self, detection: &Detection, config: &NetworkConfig) {
        self.filter.update(&Sighting::of(detection, config));
        let speed_mps = self.filter.velocity().norm();
        let sigma_mps = SLIP_MPS + config.heading_sigma_rad * speed_mps;
        self.filter.align(&detection.heading, sigma_mps);
        self.heading = detection.heading;
        self.turn(config);
        self.weight += detection.likely;
        let share = detection.likely / self.weight;
        for (size_m, seen_m) in self.size_m.iter_mut().zip(detection.size_m) {
            *size_m += share * (seen_m - *size_m);
        }
        self.score = (self.score + evidence(detection, config)).min(config.max_score);
        self.hits = self.hits.saturating_add(1);
        self.unseen_s = 0.0;
    }

    /// Notes that a scan does not show it.
    pub fn miss(&mut self, config: &NetworkConfig) {
        self.score -= config.missed_loss;
    }

    /// Turns the heading into the direction of the motion.
    fn turn(&mut self, config: &NetworkConfig) {
        let velocity = self.filter.velocity();
        if velocity.norm() > config.heading_mps {
            self.heading = velocity.normalize();
        }
    }

    pub fn is_object(&self) -> bool {
        self.id.is_some()
    }

    /// Returns whether it is not there any more: neither seen nor expected.
    pub fn is_lost(&self, config: &NetworkConfig) -> bool {
        self.unseen_s > config.coast_s || self.score < config.end_score
    }

    /// Returns whether it has come to its end. An object keeps its identity for longer.
    pub fn is_over(&self, config: &NetworkConfig) -> bool {
        let ends_s = match (self.is_object(), self.has_stopped(config)) {
            (false, _) => 0.0,
            (true, false) => config.lost_s,
            (true, true) => config.stopped_s,
        };
        self.is_lost(config) && self.unseen_s > ends_s
    }

    /// Returns whether it was about to stand when it was lost: the network finds what moves.
    fn has_stopped(&self, config: &NetworkConfig) -> bool {
        self.is_lost(config) && self.filter.velocity().norm() < config.stopping_mps
    }

    /// Returns how far from where a lost object would be now a track is that has become an object;
    /// `None` if it is another one, as what was seen before this one was lost.
    pub fn distance(&self, found: &Self, config: &NetworkConfig) -> Option<f64> {
        let may_be = self.is_object() && self.is_lost(config) && found.known_s < self.unseen_s;
        let chi_square = self.filter.apart(&found.filter);
        (may_be && chi_square <= config.gate).then_some(chi_square)
    }

    /// Ends it, and returns its identity.
    pub fn give_up(&mut self) -> u64 {
        self.score = f64::NEG_INFINITY;
        self.unseen_s = f64::INFINITY;
        self.id.take().unwrap_or_default()
    }

    /// Decides whether it moves: whether its speed is above that of what stands by more than its
    /// uncertainty explains. Returns whether it becomes an object by that.
    pub fn judge(&mut self, config: &NetworkConfig) -> bool {
        let (speed_mps, sigma_mps) = self.filter.speed();
        self.moving = speed_mps - config.standing_mps > config.moving_sigmas * sigma_mps;
        self.moving
            && !self.is_object()
            && self.hits >= config.birth_hits
            && self.score > config.confirm_score
    }

    /// Makes it an object.
    pub fn confirm(&mut self, id: u64) {
        self.id = Some(id);
    }

    /// Returns whether another track is of the same vehicle.
    pub fn is_same(&self, other: &Self) -> bool {
        (self.position() - other.position()).norm() < SAME_M
    }

    fn position(&self) -> Point2<f64> {
        self.filter.position()
    }

    /// Returns the object, if it is one that is seen, or has been seen well until a moment ago: one
    /// that may have gone elsewhere keeps its identity in case that it is seen again.
    pub fn object(&self, config: &NetworkConfig) -> Option<Object> {
        let is_there = self.unseen_s == 0.0 && self.score > config.keep_score
            || self.score > config.confirm_score;
        let id = self.id.filter(|_| is_there)?;
        let [length_m, width_m] = self.size_m;
        Some(Object {
            id,
            position: self.position(),
            velocity: self.filter.velocity(),
            yaw_rad: self.heading.y.atan2(self.heading.x),
            length_m,
            width_m,
            moving: self.moving,
            age: self.age,
            position_covariance: self.filter.position_covariance(),
            velocity_covariance: self.filter.velocity_covariance(),
        })
    }
}

/// Returns the logarithm of how much likelier an object is than none, by what a scan shows.
fn evidence(detection: &Detection, config: &NetworkConfig) -> f64 {
    let odds = |likely: f64| {
        let likely = likely.clamp(1e-3, 1.0 - 1e-3);
        (likely / (1.0 - likely)).ln()
    };
    odds(detection.likely) - odds(config.even_likely)
}
