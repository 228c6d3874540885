//! A track: an object from its birth to its death.

use std::collections::VecDeque;
use std::f64::consts::FRAC_PI_4;

use nalgebra::{Matrix2, Point2, Vector2};

use crate::clusters::Cluster;
use crate::evidence::Evidence;
use crate::extent::{Extent, Sight};
use crate::filter::{Filter, Sighting, by_time_and_doppler};
use crate::returns::Return;
use crate::{Object, ObjectsConfig, score};

/// Scans of which the places of its returns are kept, and how many places of each.
const TRAIL_SCANS: usize = 5;
const TRAIL_POINTS: usize = 8;
/// Distance from all of its returns at which it has left a place, m: beyond the neighbouring cells.
const LEFT_M: f64 = 2.0;
/// Length in which returns are an object's, while its own is not known to be longer, m: a van.
const CLAIMED_M: f64 = 5.6;
/// Chi-square of two degrees of freedom that one pair of ends in a hundred exceeds.
const ALIKE: f64 = 9.2;
/// Standard deviations of its place within which a return at a new place is an object's.
const NEW_SIGMAS: f64 = 3.0;
/// Distance beyond an outline within which the first returns of another track are of it, m.
const BESIDE_M: f64 = 1.0;
/// Share of the size that is uncertain when an object becomes a box.
const SIZE_SIGMA: f64 = 0.15;

/// Bounds of the standard deviation of a predicted heading, rad: that of a vehicle which drives
/// straight, and one beyond which its side may be its end.
const LEAST_TURN_RAD: f64 = 0.02;
const LARGEST_TURN_RAD: f64 = 0.5;
/// Speed of a vehicle's centre across its heading, m/s: it has its place by the rear axle.
const SLIP_MPS: f64 = 0.1;
/// Factor of the standard deviation of a heading by the returns of one scan: the differences
/// between edges and scatterers last for several.
const LASTING: f64 = 2.0;

/// An object that may be one.
#[derive(Clone, Debug)]
pub(crate) struct Track {
    pub filter: Filter,
    pub extent: Extent,
    heading: Vector2<f64>,
    /// The line of sight to it when it was last seen.
    direction: Vector2<f64>,
    /// True if the filter's position is the centre of a box, false if it is the near end of what is
    /// seen.
    is_box: bool,
    /// From one end to the other of what was last seen, along the heading and relative to the
    /// position, m.
    span_m: [f64; 2],
    /// True for what began behind something that stands: it becomes no object, and ends a scan
    /// later, so that what has come out from behind an obstacle begins anew.
    pub is_image: bool,
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
    /// Logarithm of the likelihood of an object over that of clutter: see [`score`].
    score: f64,
}

impl Track {
    /// Begins a track at a cluster.
    pub fn new(
        returns: &[Return],
        cluster: &Cluster,
        noise: &Matrix2<f64>,
        config: &ObjectsConfig,
    ) -> Self {
        let mut track = Self {
            filter: Filter::new(
                &Sighting::of_near_end(&cluster.measured, noise),
                config.speed_sigma_mps,
            ),
            extent: Extent::new(config),
            heading: cluster.measured.direction,
            direction: cluster.measured.direction,
            is_box: false,
            span_m: [0.0; 2],
            is_image: false,
            id: None,
            age: 1,
            hits: 1,
            unseen_s: 0.0,
            moving: false,
            score: 0.0,
            trail: VecDeque::new(),
        };
        track.leave(returns, cluster);
        track
    }

    /// Predicts it some seconds later.
    pub fn predict(&mut self, dt_s: f64, config: &ObjectsConfig) {
        self.filter.predict(dt_s, &self.heading, config);
        self.turn(config);
        self.age = self.age.saturating_add(1);
        if self.unseen_s > 0.0 {
            self.score += (1.0 - config.seen_share).ln();
        }
        self.unseen_s += dt_s;
    }

    /// Returns whether it has been confirmed as an object.
    pub fn is_confirmed(&self) -> bool {
        self.id.is_some()
    }

    /// Returns whether its position is the centre of a box.
    pub fn is_box(&self) -> bool {
        self.is_box
    }

    /// Returns whether it is an object that moves.
    pub fn is_moving(&self) -> bool {
        self.is_confirmed() && self.moving
    }

    /// Returns the distance of a return from the predicted outline, in units of the margin around
    /// it: up to 1 it belongs to the object. The margin is wider for a return at a new place.
    pub fn distance(&self, found: &Return, config: &ObjectsConfig) -> f64 {
        let place = found.at_scan(&self.filter.velocity()) - self.filter.position();
        let side = Vector2::new(-self.heading.y, self.heading.x);
        let [length_m, width_m] = self.extent.size_m;
        let variance = self.filter.position_covariance();
        let is_new = found.share < config.standing_share;
        let sigmas = if is_new { NEW_SIGMAS } else { 1.0 };
        let beyond = |axis: &Vector2<f64>, size_m: f64| {
            let sigma_m = (axis.transpose() * variance * axis)[0].max(0.0).sqrt();
            // The bearing of a single return is off by about its range over a hundred.
            let margin_m = config.margin_m + sigmas * sigma_m + 0.01 * found.range_m;
            (place.dot(axis).abs() - 0.5 * size_m).max(0.0) / margin_m
        };
        beyond(&self.heading, length_m.max(CLAIMED_M)).hypot(beyond(&side, width_m))
    }

    /// Returns where a cluster says that the filter's position is. `noise` is the covariance of the
    /// place of an end.
    pub fn sighting(
        &self,
        returns: &[Return],
        cluster: &Cluster,
        noise: &Matrix2<f64>,
    ) -> Sighting {
        let measured = &cluster.measured;
        if !self.is_box {
            return Sighting::of_near_end(measured, noise);
        }
        let known = (&self.filter.position(), &self.filter.velocity());
        let sight = self.sight(cluster, noise);
        let outline = Extent::outline(cluster.body(returns), known, &sight.heading);
        let found = self.extent.centre(&outline, &sight);
        let by_velocity = by_time_and_doppler(measured);
        Sighting {
            at: known.0 + found.offset + by_velocity * known.1,
            noise: found.noise,
            by_velocity,
        }
    }

    /// Turns the heading to that of the box by its returns. Returns the heading that these alone
    /// say, and its standard deviation, rad; `None` where they say nothing, or it has no direction
    /// of motion that tells one end from the other.
    fn measure_heading(
        &mut self,
        returns: &[Return],
        cluster: &Cluster,
        noise: &Matrix2<f64>,
        config: &ObjectsConfig,
    ) -> Option<(Vector2<f64>, f64)> {
        let velocity = self.filter.velocity();
        if !self.is_box || velocity.norm() < config.heading_mps {
            return None;
        }
        let sigma_rad = self.heading_sigma_rad();
        let known = (&self.filter.position(), &velocity);
        let sight = self.sight(cluster, noise);
        let turn = self
            .extent
            .turn(cluster.body(returns), known, (&sight, sigma_rad));
        self.heading = sight.turned(turn.mean_rad).heading;
        // What the returns add to the prediction: the quotient of the two distributions.
        let information = 1.0 / turn.variance_rad2 - 1.0 / sigma_rad.powi(2);
        let alone_rad = turn.mean_rad / turn.variance_rad2 / information;
        let is_measured = information > 0.0 && alone_rad.abs() < FRAC_PI_4;
        is_measured.then(|| (sight.turned(alone_rad).heading, information.sqrt().recip()))
    }

    /// The standard deviation of the direction of the predicted velocity, rad.
    fn heading_sigma_rad(&self) -> f64 {
        let side = Vector2::new(-self.heading.y, self.heading.x);
        let variance = (side.transpose() * self.filter.velocity_covariance() * side)[0];
        let speed_mps = self.filter.velocity().norm();
        (variance.max(0.0).sqrt() / speed_mps).clamp(LEAST_TURN_RAD, LARGEST_TURN_RAD)
    }

    /// Updates the filter by where a cluster says that it is and points to. Returns the squared
    /// Mahalanobis distance of the place from the prediction.
    fn update_filter(&mut self, sighting: &Sighting, heading: Option<(Vector2<f64>, f64)>) -> f64 {
        let chi_square = self.filter.innovation(sighting).chi_square();
        self.filter.update(sighting);
        if let Some((heading, sigma_rad)) = heading {
            let speed_mps = self.filter.velocity().norm();
            let sigma_mps = SLIP_MPS + LASTING * sigma_rad * speed_mps;
            self.filter.align(&heading, sigma_mps);
        }
        chi_square
    }

    fn sight(&self, cluster: &Cluster, noise: &Matrix2<f64>) -> Sight {
        Sight {
            heading: self.heading,
            direction: cluster.measured.direction,
            predicted: self.filter.position_covariance(),
            noise: *noise,
        }
    }

    /// Updates it by a cluster. `noise` is the covariance of the place of an end.
    pub fn update(
        &mut self,
        returns: &[Return],
        cluster: &Cluster,
        noise: &Matrix2<f64>,
        config: &ObjectsConfig,
    ) {
        let heading = self.measure_heading(returns, cluster, noise, config);
        self.resize(returns, cluster, noise, config);
        let sighting = self.sighting(returns, cluster, noise);
        let chi_square = self.update_filter(&sighting, heading);
        let evidence = score::of_cluster(returns, &cluster.members, chi_square);
        self.add(evidence, config);
        self.direction = cluster.measured.direction;
        self.leave(returns, cluster);
        self.unseen_s = 0.0;
        self.hits = self.hits.saturating_add(1);
        self.turn(config);
        if self.has_heading(config) {
            self.become_box();
        }
    }

    /// Takes the size that a cluster shows.
    fn resize(
        &mut self,
        returns: &[Return],
        cluster: &Cluster,
        noise: &Matrix2<f64>,
        config: &ObjectsConfig,
    ) {
        if self.is_box {
            let known = (&self.filter.position(), &self.filter.velocity());
            let outline = Extent::outline(cluster.body(returns), known, &self.heading);
            let sight = self.sight(cluster, noise);
            let moved = self.extent.update(&outline, &sight, config);
            self.filter.shift(&moved, &Matrix2::zeros());
            self.span_m = outline.spans_m[0].map(|at_m| at_m - moved.dot(&self.heading));
        }
    }

    /// Refers the position to the centre instead of the near end: half of the size, as it is seen,
    /// beyond it.
    fn become_box(&mut self) {
        if !self.is_box {
            let side = Vector2::new(-self.heading.y, self.heading.x);
            let [length_m, width_m] = self.extent.size_m;
            let depth_m = length_m * self.heading.dot(&self.direction).abs()
                + width_m * side.dot(&self.direction).abs();
            let line = self.direction * self.direction.transpose();
            let variance = line * (SIZE_SIGMA * depth_m).powi(2);
            self.filter
                .shift(&(self.direction * (0.5 * depth_m)), &variance);
            self.is_box = true;
        }
    }

    /// Turns the heading into the direction of the motion.
    fn turn(&mut self, config: &ObjectsConfig) {
        let velocity = self.filter.velocity();
        if velocity.norm() > config.heading_mps {
            self.heading = velocity.normalize();
        }
    }

    /// Notes where its returns are.
    fn leave(&mut self, returns: &[Return], cluster: &Cluster) {
        let step = cluster.members.len().div_ceil(TRAIL_POINTS);
        let places = cluster
            .members
            .iter()
            .step_by(step.max(1))
            .map(|member| returns[*member as usize].at);
        self.trail.push_front(places.collect());
        self.trail.truncate(TRAIL_SCANS);
    }

    /// Looks at what is now where it was: behind an object the way is free, while a surface that
    /// has come into view, scan by scan, stays.
    pub fn look_back(&mut self, evidence: &Evidence, config: &ObjectsConfig) {
        let Some(now) = self.trail.front().filter(|_| self.unseen_s == 0.0) else {
            // An obstacle may hide it, but it is not where the beam goes on.
            if evidence.is_occupied(&self.filter.position()) == Some(false) {
                self.add(-config.missed_loss, config);
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
            let evidence = score::of_places_left(taken as f64 / f64::from(count));
            self.add(evidence, config);
        }
    }

    fn add(&mut self, evidence: f64, config: &ObjectsConfig) {
        self.score = (self.score + evidence).min(config.max_score);
    }

    /// Returns whether the direction of its motion is known.
    fn has_heading(&self, config: &ObjectsConfig) -> bool {
        let (speed_mps, sigma_mps) = self.filter.speed();
        let is_sure = speed_mps > config.heading_mps + 2.0 * sigma_mps;
        self.is_confirmed() || (self.hits > 2 && is_sure)
    }

    /// Returns whether it has come to its end.
    pub fn is_over(&self, config: &ObjectsConfig) -> bool {
        let missed = self.age - self.hits;
        let is_given_up = self.score < config.end_score && self.age > 1;
        match self.is_confirmed() {
            true => self.unseen_s > config.coast_s || is_given_up,
            false => {
                is_given_up
                    || self.is_image && self.age > 1
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
            && !self.is_image
            && self.hits >= config.birth_hits
            && self.score > config.confirm_score
    }

    /// Makes it an object.
    pub fn confirm(&mut self, id: u64) {
        self.id = Some(id);
        self.become_box();
    }

    /// Returns the object, if it is one that is seen, or has been seen well until a moment ago: one
    /// that may have gone elsewhere keeps its identity in case that it is seen again.
    pub fn object(&self, config: &ObjectsConfig) -> Option<Object> {
        let is_there = self.unseen_s == 0.0 || self.score > config.confirm_score;
        let id = self.id.filter(|_| is_there)?;
        let [length_m, width_m] = self.extent.size_m;
        Some(Object {
            id,
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
    pub fn is_same(&self, other: &Self, config: &ObjectsConfig) -> bool {
        let (along_m, aside_m) = self.apart(&other.filter.position());
        let [length_m, width_m] = self.extent.size_m;
        let beyond_m = match other.is_box {
            true => 0.5 * other.extent.size_m[0],
            false => BESIDE_M,
        };
        let is_inside = along_m.abs() < 0.5 * length_m;
        let is_beside = along_m.abs() < 0.5 * length_m + beyond_m;
        aside_m.abs() < width_m && (is_inside || is_beside && self.moves_like(other, config))
    }

    /// Takes over another track if the two are the ends of one long object, between which nothing
    /// is seen: they move alike, one behind the other, and neither is as long as a vehicle.
    /// Returns whether they are.
    pub fn unite(&mut self, other: &Self, config: &ObjectsConfig) -> bool {
        let is_end =
            |track: &Self| track.is_box && track.unseen_s == 0.0 && track.extent.is_an_end(config);
        let (_, aside_m) = self.apart(&other.filter.position());
        let is_behind = aside_m.abs() < self.extent.size_m[1];
        if !(is_end(self) && is_end(other) && is_behind && self.moves_like(other, config)) {
            return false;
        }
        let ends = other.span_m.map(|at_m| {
            let end = other.filter.position() + other.heading * at_m;
            self.apart(&end).0
        });
        self.stretch(&ends, config)
    }

    /// Makes it as long as from what was seen of it to some other ends of it, m along the heading.
    /// Returns whether a vehicle can be that long.
    fn stretch(&mut self, ends_m: &[f64], config: &ObjectsConfig) -> bool {
        let all = self.span_m.iter().chain(ends_m);
        let (low, high) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at_m| {
            (low.min(*at_m), high.max(*at_m))
        });
        let fits = self.extent.lengthen(high - low, config);
        if fits {
            let middle_m = 0.5 * (low + high);
            let variance = Matrix2::identity() * config.margin_m.powi(2);
            self.filter.shift(&(self.heading * middle_m), &variance);
            self.span_m = [low, high].map(|at_m| at_m - middle_m);
        }
        fits
    }

    /// Returns how far a place is from the position along the heading and to its left, m.
    fn apart(&self, place: &Point2<f64>) -> (f64, f64) {
        let apart = place - self.filter.position();
        (apart.dot(&self.heading), self.heading.perp(&apart))
    }

    /// Returns whether another track has the same velocity, within some m/s and the uncertainty.
    fn moves_like(&self, other: &Self, config: &ObjectsConfig) -> bool {
        let faster = other.filter.velocity() - self.filter.velocity();
        let variance = self.filter.velocity_covariance() + other.filter.velocity_covariance();
        let chi_square = variance.try_inverse().map_or(f64::INFINITY, |inverse| {
            (faster.transpose() * inverse * faster)[0]
        });
        faster.norm() < config.alike_mps && chi_square < ALIKE
    }
}
