//! Along walls without structure, as in a tunnel: the radar sees where they are, but not how far
//! the vehicle drives.
//!
//! The place along them is the predicted one, by wheels, by Doppler or at constant velocity, with
//! the covariance of that; across them and of the heading the radar tells as elsewhere. Until the
//! search, which compares two scans and no map, contradicts the prediction, the place is that of
//! the match, or at constant velocity the mean of prediction and search.
//!
//! At constant velocity the vehicle may drive faster or slower. Keyframes at such places would
//! share no structure, and so not tell where the walls end. So in the map the vehicle goes on to
//! where the search finds it: while it finds anything, behind the walls, that is right.

use gyre_geometry::{Pose, UncertainMotion};
use nalgebra::{UnitVector2, Vector2};

use super::{
    InitialGuess, Refiner,
    alignment::Alignment,
    registration::{Candidate, Scan},
    structure::WeakestDirection,
    uncertainty::{self, Uncertainty},
};

/// A plausible match of a scan.
pub(super) struct Match {
    /// Its pose, with the covariance of the motion to it.
    pub registered: UncertainMotion,
    /// The direction along the axes of the map in which nothing determines the place.
    pub undetermined: Option<UnitVector2<f64>>,
    /// From its place to where the vehicle goes on in the map, m.
    pub ahead_m: Vector2<f64>,
}

impl Refiner {
    /// Returns the pose of the best match with the covariance of its motion; `None` where it is not
    /// plausible. In a direction in which nothing determines the place the predicted one is taken,
    /// or the mean of prediction and search: that becomes the best match, and has to be reachable.
    pub(super) fn plausible_match(
        &mut self,
        scan: &Scan<'_>,
        best: &mut Candidate,
        uncertainty: &Uncertainty,
    ) -> Option<Match> {
        let registered = self.registered(&best.alignment)?;
        let along = self.undetermined(scan, &best.alignment, &registered);
        let Some(along) = along.filter(|_| best.fits) else {
            return best.is_plausible.then_some(Match {
                registered,
                undetermined: None,
                ahead_m: Vector2::zeros(),
            });
        };
        let is_guessed = scan.step.distance.is_none();
        let is_searched =
            is_guessed && self.asks_search() && self.is_near(&scan.searched, scan, along);
        let [predicted, _] = self.state.predict(&scan.step);
        let mut place = predicted.translation.vector;
        if is_searched {
            // The search is noisier than the prediction, which does not know of accelerations.
            place = (place + scan.searched.translation.vector) * 0.5;
        }
        let to = |place: Vector2<f64>, from: &Pose| {
            along.into_inner() * along.dot(&(place - from.translation.vector))
        };
        let mut initial = best.alignment.pose;
        initial.translation.vector += to(place, &initial);
        let guess = match is_searched {
            true => InitialGuess::Search,
            false => InitialGuess::AlongWalls,
        };
        let mut registration = self.registration(scan);
        let across = registration.align_across(guess, &initial, along);
        if !registration.is_reachable(&across.alignment.pose, across.support) {
            return None;
        }
        let registered = self.registered(&across.alignment)?;
        *best = across;
        Some(match is_searched {
            true => Match {
                registered: self.placed(registered, along, self.step_m(scan).powi(2)),
                undetermined: Some(along),
                ahead_m: Vector2::zeros(),
            },
            false => Match {
                registered: self.slid(scan, registered, along, uncertainty),
                undetermined: Some(along),
                ahead_m: match is_guessed {
                    true => to(scan.searched.translation.vector, &registered.motion),
                    false => Vector2::zeros(),
                },
            },
        })
    }

    /// Returns the direction along the axes of the map in which the place of a registered pose is
    /// undetermined, if there is one. In one that is doubtful wheels or Doppler decide. While the
    /// search is asked, there is none where both match and search are near the prediction.
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
        let is_seen = || self.asks_search() && is_near(&scan.searched) && is_near(&alignment.pose);
        (is_undetermined && !is_seen()).then_some(weakest.along)
    }

    /// Returns whether the search is asked: the scan before was not moved along walls.
    fn asks_search(&self) -> bool {
        self.state.along_walls == 0
    }

    /// Returns whether a pose is near the predicted one in a direction. In a tunnel that of the
    /// match soon is metres away, and some scans later that of the search too. Elsewhere both stay
    /// near.
    fn is_near(&self, pose: &Pose, scan: &Scan<'_>, along: UnitVector2<f64>) -> bool {
        let [predicted, _] = self.state.predict(&scan.step);
        let apart = pose.translation.vector - predicted.translation.vector;
        along.dot(&apart).abs() < self.step_m(scan)
    }

    /// Returns how much farther than predicted a vehicle drives if it accelerates, m.
    fn step_m(&self, scan: &Scan<'_>) -> f64 {
        let age_s = self.state.anchors[0].map_or(0.0, |anchor| anchor.age_s);
        self.config.acceleration_mps2 * (age_s + scan.step.interval_s).powi(2)
    }

    /// Returns a registered pose with the covariance that the prediction has in a direction in
    /// which nothing else tells the place: by wheels, by Doppler, or at constant velocity.
    fn slid(
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
        self.placed(registered, along, uncertainty.of_sliding(ahead, sliding))
    }

    /// Returns a registered pose with this variance in a direction of the map, all of which
    /// accumulates, m².
    fn placed(
        &self,
        registered: UncertainMotion,
        along: UnitVector2<f64>,
        variance: f64,
    ) -> UncertainMotion {
        let along = self.state.pose.rotation.inverse() * along.into_inner();
        let drift_share = uncertainty::drift_share(self.map.len(), &self.config);
        UncertainMotion {
            covariance: uncertainty::with_variance(
                &registered.covariance,
                along.push(0.0),
                variance / drift_share,
            ),
            ..registered
        }
    }

    /// Takes a scan whose place along the walls is the predicted one.
    pub(super) fn slide(&mut self, scan: &Scan<'_>, registered: &UncertainMotion) {
        self.state.along_walls = self.state.along_walls.saturating_add(1);
        self.state.sliding = match scan.step.distance {
            Some(_) => 0,
            None => self.state.sliding.saturating_add(1),
        };
        self.each_distance(registered, |state, measured, driven, _| {
            state.slide_along(measured, driven);
        });
    }
}
