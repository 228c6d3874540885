//! A track: an object from its birth to its death.

use std::collections::VecDeque;

use nalgebra::{Matrix2, Point2, Vector2};

use crate::clusters::Measurement;
use crate::evidence::Evidence;
use crate::extent::Extent;
use crate::filter::Filter;
use crate::returns::Return;
use crate::{Object, ObjectsConfig, score};

/// Speed above which the velocity is the heading, m/s.
const HEADING_MPS: f64 = 1.0;
/// Share of the scans in which an object is seen.
const SEEN_SHARE: f64 = 0.8;
/// Evidence of a scan without a cluster that had the place of the object in view.
const MISSED_IN_VIEW: f64 = -1.5;
/// Scans of which the places of its returns are kept, and how many places of each.
const TRAIL_SCANS: usize = 5;
const TRAIL_POINTS: usize = 8;
/// Distance from all of its returns at which it has left a place, m: beyond the neighbouring cells.
const LEFT_M: f64 = 2.0;
/// The largest score, and the one below which a track that is not an object is given up.
const MAX_SCORE: f64 = 8.0;
const MIN_SCORE: f64 = -3.0;
/// Share of the mean misfit that is kept from scan to scan.
const KEPT: f64 = 0.5;
/// Factors on the accelerations for each unit of the mean misfit, and the largest: an object that
/// turns or brakes is farther from its prediction than straight driving explains.
const MANOEUVRE: f64 = 2.0;
const MAX_MANOEUVRE: f64 = 4.0;
/// Largest misfit of a scan.
const MAX_MISFIT: f64 = 10.0;
/// Length in which returns are an object's, while its own is not known to be longer, m: a van.
const CLAIMED_M: f64 = 5.6;
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
    /// Running mean of half of the squared Mahalanobis distance between measurement and prediction:
    /// 1 where the motion is as expected.
    misfit: f64,
    /// Logarithm of the likelihood of an object over that of clutter: see [`score`].
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
            misfit: 0.0,
            trail: VecDeque::new(),
        }
    }

    /// Predicts it some seconds later.
    pub fn predict(&mut self, dt_s: f64, config: &ObjectsConfig) {
        let manoeuvre = (MANOEUVRE * self.misfit).clamp(1.0, MAX_MANOEUVRE);
        let accelerations = [config.acceleration_mps2, config.lateral_acceleration_mps2]
            .map(|sigma| sigma * manoeuvre);
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
        beyond(&self.heading, length_m.max(CLAIMED_M)).hypot(beyond(&side, width_m))
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
    ) {
        let at = match self.has_heading() {
            true => self.measured_centre(returns, members, measured),
            false => measured.at,
        };
        let innovation = self.filter.innovation(measured, &at, noise);
        let misfit = (0.5 * innovation.chi_square()).min(MAX_MISFIT);
        self.misfit = KEPT * self.misfit + (1.0 - KEPT) * misfit;
        self.filter.update(&innovation);
        self.add(score::of_cluster(returns, members, innovation.chi_square()));
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
            // An obstacle may hide it, but it is not where the beam goes on.
            if evidence.is_occupied(&self.filter.position()) == Some(false) {
                self.add(MISSED_IN_VIEW);
            }
            return;
        };
        let has_left = |place: &&Point2<f64>| now.iter().all(|at| (at - *place).norm() > LEFT_M);
        let left = self.trail.iter().skip(1).flatten().filter(has_left);
        let seen = left.filter_map(|place| evidence.is_occupied(place));
        let (count, taken) = seen.fold((0, 0), |(count, taken), is_taken| {
            (count + 1, taken + usize::from(is_taken))
        });
        if count >= 2 {
            self.add(score::of_places_left(taken as f64 / f64::from(count)));
        }
    }

    fn add(&mut self, evidence: f64) {
        self.score = (self.score + evidence).min(MAX_SCORE);
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
                self.score < MIN_SCORE && self.age > 1
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
            && self.score > config.confirm_score
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
