//! Along walls without structure, as in a tunnel: the radar sees where they are, but not how far
//! the vehicle drives.
//!
//! The place along them is predicted, by wheels, by Doppler or at constant velocity, with the
//! prediction's covariance; across them, and for the heading, the radar determines the pose as
//! elsewhere. Until the search, which compares two scans and no map, contradicts the prediction,
//! the place comes from the match, or at constant velocity from the mean of prediction and search.

use gyre_geometry::{Pose, UncertainMotion};
use nalgebra::{UnitVector2, Vector2};

use super::{
    InitialGuess, Refiner,
    alignment::Alignment,
    candidates::{Candidate, Scan},
    structure::WeakestDirection,
    uncertainty::{self, Uncertainty},
};

/// The least motion whose curvature counts, m.
const MIN_STEP_M: f64 = 0.5;

pub(super) struct Match {
    pub registered: UncertainMotion,
    pub undetermined: Option<UnitVector2<f64>>,
    pub ahead_m: Vector2<f64>,
    pub leaves_map: bool,
}

impl Match {
    fn of(registered: UncertainMotion, undetermined: Option<UnitVector2<f64>>) -> Self {
        Self {
            registered,
            undetermined,
            ahead_m: Vector2::zeros(),
            leaves_map: false,
        }
    }
}

impl Refiner {
    /// Returns the pose of the best match with the covariance of its motion; `None` where it is not
    /// plausible. In an undetermined direction the place is the predicted one, or the mean of
    /// prediction and search: that becomes the best match, and has to be plausible.
    pub(super) fn plausible_match(
        &mut self,
        scan: &Scan<'_>,
        best: &mut Candidate,
        uncertainty: &Uncertainty,
    ) -> Option<Match> {
        let registered = self.registered(scan, &best.alignment)?;
        let along = self.undetermined(scan, &best.alignment, &registered);
        let Some(along) = along.filter(|_| best.fits) else {
            return best.is_plausible.then_some(Match::of(registered, None));
        };
        self.match_across(scan, best, along, uncertainty)
    }

    /// Replaces a match by that whose place in a direction is the predicted one, or the mean of
    /// prediction and search; `None` where that is not plausible.
    fn match_across(
        &mut self,
        scan: &Scan<'_>,
        best: &mut Candidate,
        along: UnitVector2<f64>,
        uncertainty: &Uncertainty,
    ) -> Option<Match> {
        let is_guessed = scan.step.distance.is_none();
        let is_searched =
            is_guessed && self.asks_search() && self.is_near(&scan.searched, scan, along);
        let [predicted, _] = self.state.predict(&scan.step);
        let [predicted, searched] = [&predicted, &scan.searched].map(|it| it.translation.vector);
        let (guess, place) = match is_searched {
            // The search is noisier than the prediction, which does not know of accelerations.
            true => (InitialGuess::Search, (predicted + searched) * 0.5),
            false => (InitialGuess::AlongWalls, predicted),
        };
        let ahead_to = |place: Vector2<f64>, pose: &Pose| {
            along.into_inner() * along.dot(&(place - pose.translation.vector))
        };
        let mut initial = best.alignment.pose;
        initial.translation.vector += ahead_to(place, &initial);
        let across = self.candidates(scan).align_across(guess, &initial, along);
        if !across.is_plausible {
            return None;
        }
        let registered = self.registered(scan, &across.alignment)?;
        *best = across;
        let mut found = Match::of(registered, Some(along));
        if is_guessed && !is_searched {
            found.ahead_m = ahead_to(searched, &registered.motion);
            let mut place = registered.motion;
            place.translation.vector += found.ahead_m;
            if self.sees_by_search(scan, &place) {
                best.guess = InitialGuess::Search;
                found.registered.motion = place;
                (found.ahead_m, found.leaves_map) = (Vector2::zeros(), true);
            }
        }
        let of_search = self.step_m(scan).powi(2);
        found.registered = match best.guess {
            InitialGuess::AlongWalls => {
                self.with_predicted_place(scan, found.registered, along, uncertainty)
            }
            // Without its map nothing takes back an error of the place.
            _ if found.leaves_map => self.placed(found.registered, along, of_search, 1.0),
            _ => self.placed(found.registered, along, of_search, self.drift_share()),
        };
        Some(found)
    }

    /// Returns whether the walls along a stretch of guesses have ended: keyframes placed by the
    /// search overlap enough to constrain the position.
    fn sees_by_search(&mut self, scan: &Scan<'_>, place: &Pose) -> bool {
        if self.state.sliding == 0 {
            return false;
        }
        self.candidates(scan).registration().deskew(place);
        WeakestDirection::by_search(&self.map, &self.points, place, self.state.ahead_m)
            .is_some_and(|weakest| !weakest.is_doubtful())
    }

    /// Returns the direction along the axes of the map that leaves the place of a registered pose
    /// undetermined, if there is one. In one that is doubtful wheels or Doppler decide. While the
    /// search is used, the place counts as determined if match, search and prediction are near each
    /// other.
    pub(super) fn undetermined(
        &self,
        scan: &Scan<'_>,
        alignment: &Alignment,
        registered: &UncertainMotion,
    ) -> Option<UnitVector2<f64>> {
        let weakest = WeakestDirection::of(&self.map, &self.points, alignment)?;
        let contradicts = || self.contradicts_distance(scan, registered);
        let is_undetermined = weakest.is_undetermined()
            || (weakest.is_doubtful() && (self.state.sliding > 0 || contradicts()));
        let is_near = |pose: &Pose| self.is_near(pose, scan, weakest.along);
        let agree = || {
            let apart = scan.searched.translation.vector - alignment.pose.translation.vector;
            weakest.along.dot(&apart).abs() < 2.0 * self.acceleration_m(scan.step.interval_s)
        };
        let is_seen = || {
            self.asks_search()
                && !contradicts()
                && is_near(&scan.searched)
                && is_near(&alignment.pose)
                && agree()
        };
        (is_undetermined && !is_seen()).then_some(weakest.along)
    }

    fn asks_search(&self) -> bool {
        self.state.along_walls == 0
    }

    /// Returns whether a pose is near the predicted one in a direction. In a tunnel the match's
    /// pose soon is metres away, and some scans later the search's, too. Elsewhere both stay near.
    fn is_near(&self, pose: &Pose, scan: &Scan<'_>, along: UnitVector2<f64>) -> bool {
        let [predicted, _] = self.state.predict(&scan.step);
        let apart = pose.translation.vector - predicted.translation.vector;
        along.dot(&apart).abs() < self.step_m(scan)
    }

    /// Returns how much farther than predicted a vehicle drives if it accelerates, m: since the
    /// last refined scan, or since the scan before if the displacement is measured.
    fn step_m(&self, scan: &Scan<'_>) -> f64 {
        let age_s = match (scan.step.distance, &self.state.anchors[0]) {
            (None, Some(anchor)) => anchor.age_s,
            _ => 0.0,
        };
        self.acceleration_m(age_s + scan.step.interval_s)
    }

    fn acceleration_m(&self, time_s: f64) -> f64 {
        self.config.acceleration_mps2 * time_s.powi(2)
    }

    /// Returns a registered pose with the prediction's covariance in an undetermined direction: by
    /// wheels, by Doppler, or at constant velocity.
    fn with_predicted_place(
        &self,
        scan: &Scan<'_>,
        registered: UncertainMotion,
        along: UnitVector2<f64>,
        uncertainty: &Uncertainty,
    ) -> UncertainMotion {
        let sliding = match scan.step.distance {
            Some(_) => 0,
            None => self.state.sliding,
        };
        let ahead = self.state.pose.rotation.inverse() * along.into_inner();
        let variance = uncertainty.of_predicted_place(ahead, sliding);
        let drift_share = self.drift_share();
        let mut placed = self.placed(registered, along, variance, drift_share);
        if scan.step.distance.is_none() {
            // Walls that bend turn a scan whose place along them is wrong.
            let motion = self.state.pose.inv_mul(&registered.motion);
            let step_m = motion.translation.vector.norm().max(MIN_STEP_M);
            let per_m = motion.rotation.angle() / step_m;
            placed.covariance[(2, 2)] += per_m.powi(2) * variance / drift_share;
        }
        placed
    }

    pub(super) fn drift_share(&self) -> f64 {
        uncertainty::drift_share(self.map.len(), &self.config)
    }

    /// Returns a registered pose with this variance in a direction of the map, m². All of this
    /// variance accumulates, but only this share of a covariance.
    fn placed(
        &self,
        registered: UncertainMotion,
        along: UnitVector2<f64>,
        variance: f64,
        drift_share: f64,
    ) -> UncertainMotion {
        let along = self.state.pose.rotation.inverse() * along.into_inner();
        UncertainMotion {
            covariance: uncertainty::with_variance(
                &registered.covariance,
                along.push(0.0),
                variance / drift_share,
            ),
            ..registered
        }
    }

    pub(super) fn propagate_along_walls(&mut self, scan: &Scan<'_>, registered: &UncertainMotion) {
        self.state.along_walls = self.state.along_walls.saturating_add(1);
        self.state.sliding = match scan.step.distance {
            Some(_) => 0,
            None => self.state.sliding.saturating_add(1),
        };
        self.follow_distances(scan, registered);
    }
}
