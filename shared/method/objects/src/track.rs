//! A track: an object from its birth to its death.

use std::collections::VecDeque;
use std::f64::consts::TAU;

use nalgebra::{Matrix2, Point2, Vector2};

use crate::clusters::Measurement;
use crate::evidence::Evidence;
use crate::extent::Extent;
use crate::filter::Filter;
use crate::returns::Return;
use crate::{Object, ObjectsConfig};

/// Speed above which the velocity is the heading, m/s.
const HEADING_MPS: f64 = 1.0;
/// Share of the scans in which an object is seen.
const SEEN_SHARE: f64 = 0.8;
/// The score from which on a track is an object. By 9.2 one track of clutter in ten thousand would
/// pass if its clusters were independent; those of a hedge come back from scan to scan.
const CONFIRM_SCORE: f64 = 16.0;
/// Scans of which the places of its returns are kept, and how many places of each.
const TRAIL_SCANS: usize = 5;
const TRAIL_POINTS: usize = 8;
/// Distance from all of its returns at which it has left a place, m: beyond the neighbouring cells.
const LEFT_M: f64 = 2.0;
/// Share of the places that an object has left, and of those that clutter has, where something is
/// seen.
const TAKEN: [f64; 2] = [0.1, 0.5];
/// The largest loss of the score by one cluster: an object that brakes is one still.
const LARGEST_LOSS: f64 = -2.0;
/// Mean weights of the clusters of objects and of clutter, in the simulator's streets.
const WEIGHTS: [f64; 2] = [4.0, 1.0];
/// The largest score.
const MAX_SCORE: f64 = 20.0;
/// Difference of the velocities of two ends of one object, m/s.
const ALIKE_MPS: f64 = 3.0;
/// Distance beyond its outline within which returns are an object's, m: a range cell and the
/// smearing of the beam.
const MARGIN_M: f64 = 0.7;

/// An object that may be one.
#[derive(Clone, Debug)]
pub(crate) struct Track {
    pub filter: Filter,
    pub extent: Extent,
    heading: Vector2<f64>,
    /// Identity of an object that was moving once; before it has none.
    pub id: Option<u64>,
    /// Scans since its first cluster, that one included, and those with a cluster.
    age: u32,
    hits: u32,
    /// Time since its last cluster, s.
    unseen_s: f64,
    moving: bool,
    /// Where its returns were in the last scans, the newest first, m.
    trail: VecDeque<Vec<Point2<f64>>>,
    /// Logarithm of the likelihood of an object over that of clutter (Sittler; Blackman and Popoli,
    /// "Design and Analysis of Modern Tracking Systems", 1999, Sec. 6.2).
    score: f64,
}

impl Track {
    /// Begins a track at a cluster.
    pub fn new(measured: &Measurement, noise: &Matrix2<f64>, config: &ObjectsConfig) -> Self {
        Self {
            filter: Filter::new(measured, noise, config.speed_sigma_mps),
            extent: Extent::car(),
            heading: measured.direction,
            id: None,
            age: 1,
            hits: 1,
            unseen_s: 0.0,
            moving: false,
            score: 0.0,
            trail: VecDeque::new(),
        }
    }

    /// Predicts it some seconds later.
    pub fn predict(&mut self, dt_s: f64, config: &ObjectsConfig) {
        let accelerations = [config.acceleration_mps2, config.lateral_acceleration_mps2];
        self.filter.predict(dt_s, &self.heading, accelerations);
        self.age = self.age.saturating_add(1);
        if self.unseen_s > 0.0 {
            self.score += (1.0 - SEEN_SHARE).ln();
        }
        self.unseen_s += dt_s;
    }

    /// Returns whether it has been confirmed as an object.
    pub fn is_confirmed(&self) -> bool {
        self.id.is_some()
    }

    /// Returns whether it is an object that moves.
    pub fn is_moving(&self) -> bool {
        self.is_confirmed() && self.moving
    }

    /// Returns the distance of a return from the predicted outline, in units of the margin around
    /// it: up to 1 it belongs to the object.
    pub fn distance(&self, found: &Return) -> f64 {
        let place = found.at_scan(&self.filter.velocity()) - self.filter.position();
        let side = Vector2::new(-self.heading.y, self.heading.x);
        let [length_m, width_m] = self.extent.size_m;
        let variance = self.filter.position_covariance();
        let beyond = |axis: &Vector2<f64>, size_m: f64| {
            let sigma_m = (axis.transpose() * variance * axis)[0].max(0.0).sqrt();
            // The bearing of a single return is off by about its range over a hundred.
            let margin_m = MARGIN_M + sigma_m + 0.01 * found.range_m;
            (place.dot(axis).abs() - 0.5 * size_m).max(0.0) / margin_m
        };
        beyond(&self.heading, length_m).hypot(beyond(&side, width_m))
    }

    /// Returns where the centre is by a cluster, as it would be seen at the cluster's own time.
    pub fn measured_centre(
        &self,
        returns: &[Return],
        members: &[u32],
        measured: &Measurement,
    ) -> Point2<f64> {
        let known = (&self.filter.position(), &self.filter.velocity());
        let outline = Extent::outline(returns, members, known, &self.heading);
        let centre = self
            .extent
            .centre(&outline, &self.heading, &measured.direction);
        let away_mps = measured.direction.dot(known.1);
        known.0
            + centre
            + known.1 * measured.time_s
            + measured.direction * (measured.doppler_s * away_mps)
    }

    /// Updates it by a cluster.
    pub fn update(
        &mut self,
        returns: &[Return],
        members: &[u32],
        measured: &Measurement,
        noise: &Matrix2<f64>,
        clutter_per_m2: f64,
    ) {
        let at = match self.has_heading() {
            true => self.measured_centre(returns, members, measured),
            false => measured.at,
        };
        let innovation = self.filter.innovation(measured, &at, noise);
        self.filter.update(&innovation);
        let expected = TAU * innovation.covariance.determinant().max(1e-9).sqrt() * clutter_per_m2;
        let gain = (SEEN_SHARE / expected).ln() - 0.5 * innovation.chi_square()
            + strength(measured.weight);
        self.score = (self.score + gain.max(LARGEST_LOSS)).min(MAX_SCORE);
        self.leave(returns, members);
        self.unseen_s = 0.0;
        self.hits = self.hits.saturating_add(1);
        let velocity = self.filter.velocity();
        if velocity.norm() > HEADING_MPS {
            self.heading = velocity.normalize();
        }
        if self.has_heading() {
            let known = (&self.filter.position(), &velocity);
            let outline = Extent::outline(returns, members, known, &self.heading);
            self.extent.update(&outline);
        }
    }

    /// Notes where its returns are.
    pub fn leave(&mut self, returns: &[Return], members: &[u32]) {
        let step = members.len().div_ceil(TRAIL_POINTS);
        let places = members
            .iter()
            .step_by(step.max(1))
            .map(|member| returns[*member as usize].at);
        self.trail.push_front(places.collect());
        self.trail.truncate(TRAIL_SCANS);
    }

    /// Looks at what is now where it was: behind an object the way is free, while a surface that
    /// has come into view, scan by scan, stays.
    pub fn look_back(&mut self, evidence: &Evidence) {
        let Some(now) = self.trail.front().filter(|_| self.unseen_s == 0.0) else {
            return;
        };
        let has_left = |place: &&Point2<f64>| now.iter().all(|at| (at - *place).norm() > LEFT_M);
        let left = self.trail.iter().skip(1).flatten().filter(has_left);
        let (count, taken) = left.fold((0, 0), |(count, taken), place| {
            (count + 1, taken + usize::from(evidence.is_occupied(place)))
        });
        if count >= 2 {
            let share = taken as f64 / f64::from(count);
            let gain = share * (TAKEN[0] / TAKEN[1]).ln()
                + (1.0 - share) * ((1.0 - TAKEN[0]) / (1.0 - TAKEN[1])).ln();
            self.score = (self.score + gain).min(MAX_SCORE);
        }
    }

    /// Returns whether the direction of its motion is known: from there on its centre is that of
    /// its outline, before it is that of its returns.
    pub fn has_heading(&self) -> bool {
        let (speed_mps, sigma_mps) = self.filter.speed();
        let is_sure = speed_mps > HEADING_MPS + 2.0 * sigma_mps;
        self.is_confirmed() || (self.hits > 2 && is_sure)
    }

    /// Returns whether it has come to its end.
    pub fn is_over(&self, config: &ObjectsConfig) -> bool {
        let missed = self.age - self.hits;
        match self.is_confirmed() {
            true => self.unseen_s > config.coast_s || self.score < 0.0,
            false => {
                self.score < LARGEST_LOSS && self.age > 1
                    || missed > config.birth_scans - config.birth_hits
            }
        }
    }

    /// Decides whether it moves: whether its speed is above that of what stands by more than its
    /// uncertainty explains. Returns whether it becomes an object by that.
    pub fn judge(&mut self, config: &ObjectsConfig) -> bool {
        let (speed_mps, sigma_mps) = self.filter.speed();
        let excess = speed_mps - config.standing_mps;
        self.moving = excess > config.moving_sigmas * sigma_mps;
        self.moving
            && !self.is_confirmed()
            && self.hits >= config.birth_hits
            && self.score > CONFIRM_SCORE
    }

    /// Makes it an object: from now on it is a box whose near end is seen.
    pub fn confirm(&mut self, id: u64) {
        self.id = Some(id);
    }

    /// Returns the object, if it is one.
    pub fn object(&self) -> Option<Object> {
        let [length_m, width_m] = self.extent.size_m;
        Some(Object {
            id: self.id?,
            position: self.filter.position(),
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

/// Logarithm of the likelihood of the weight of a cluster if it is of an object, over that if it
/// is clutter: both are exponentially distributed.
fn strength(weight: f64) -> f64 {
    let [object, clutter] = WEIGHTS;
    ((clutter / object).ln() + weight * (1.0 / clutter - 1.0 / object)).min(2.0)
}

impl Track {
    /// Returns whether another track is of the same object: it lies within the outline or touches
    /// it, and moves alike.
    pub fn is_same(&self, other: &Self) -> bool {
        let apart = other.filter.position() - self.filter.position();
        let side = Vector2::new(-self.heading.y, self.heading.x);
        let [length_m, width_m] = self.extent.size_m;
        let reach_m = 0.5 * length_m
            + 0.5 * other.extent.size_m[0] * f64::from(u8::from(other.is_confirmed()));
        let faster = other.filter.velocity() - self.filter.velocity();
        apart.dot(&self.heading).abs() < reach_m.max(length_m)
            && apart.dot(&side).abs() < width_m
            && (apart.norm() < 0.5 * length_m || faster.norm() < ALIKE_MPS)
    }
}
