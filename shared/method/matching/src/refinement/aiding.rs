//! Gyro, wheels and Doppler as aiding sensors of a motion, compared with the radar's matches.

use gyre_geometry::{
    UncertainMotion,
    samples::{DopplerConfig, DopplerDisplacement, WheelDistance, WheelsConfig},
};
use nalgebra::Matrix3;

use super::{
    Heading, Refiner, WheelState,
    config::JITTER_DEG,
    heading::{PredictedTurn, Verdict, grown},
    registration::{Candidate, Scan},
    tracker::Step,
    uncertainty,
    wheels::{DistanceBy, PredictedDistance, Registered},
};

impl Refiner {
    /// Predicts the turn since the scan before by the gyro, if that has measured it.
    pub(super) fn predict_turn(&mut self, interval_s: f64) -> Option<PredictedTurn> {
        let Some(turn) = self.aiding.turn else {
            let heading = self.state.heading.iter_mut();
            heading.for_each(|heading| heading.propagate(interval_s, &self.gyro));
            return None;
        };
        let heading = self.state.heading.get_or_insert(Heading::new(&self.gyro));
        Some(heading.predict(&turn, &self.gyro))
    }

    /// Predicts the distance since the scan before by the wheels, if those have measured it and do
    /// not slip; else by Doppler, if that has and is not refused.
    pub(super) fn predict_distance(&mut self, interval_s: f64) -> Option<PredictedDistance> {
        let by_wheels = self.predict_by_wheels(interval_s);
        let by_doppler = self.predict_by_doppler(interval_s);
        by_wheels.or(by_doppler)
    }

    /// Returns the displacement since the scan before by Doppler; `None` if one of both scans does
    /// not determine its velocity.
    pub(super) fn displacement_by_doppler(&self, interval_s: f64) -> Option<DopplerDisplacement> {
        let [earlier, later] = &self.aiding.velocities;
        let both = [earlier.as_ref()?, later.as_ref()?];
        let is_used = self.doppler.is_used();
        is_used.then(|| self.doppler.displacement(both, interval_s))
    }

    fn predict_by_doppler(&mut self, interval_s: f64) -> Option<PredictedDistance> {
        let config = &self.doppler_as_wheels;
        if self.displacement.is_some() {
            self.state.doppler.get_or_insert(WheelState::new(config));
        }
        let state = self.state.doppler.as_mut()?;
        state.wait(interval_s);
        let displacement = self.displacement?;
        let predicted = state.predict(&displacement.ahead, config)?;
        // The lasting error is the error of all motions since the last match that determined the
        // place: the variance of one motion is the variance of the displacement.
        let before_s = (state.since_place_s - interval_s).max(0.0);
        let lasting = grown(interval_s, before_s) - interval_s.powi(2);
        let lasting_m2 = DopplerConfig::NOISE_MPS.powi(2) * lasting;
        Some(PredictedDistance {
            by: DistanceBy::Doppler,
            left_m: state.scale * displacement.left_m,
            variance_m2: predicted.variance_m2 + lasting_m2,
            side_variance_m2: predicted.side_variance_m2 + lasting_m2,
            ..predicted
        })
    }

    fn predict_by_wheels(&mut self, interval_s: f64) -> Option<PredictedDistance> {
        let measured = self.aiding.distance;
        if measured.is_some() {
            self.state
                .wheels
                .get_or_insert(WheelState::new(&self.wheels));
        }
        let wheels = self.state.wheels.as_mut()?;
        wheels.wait(interval_s);
        wheels.predict(&measured?, &self.wheels)
    }

    /// Returns the best match of a scan. A certain one that contradicts the gyro is that without
    /// it: the turn is taken off the scan's step. So it is until the gyro agrees again.
    pub(super) fn best_match(&mut self, scan: &mut Scan<'_>) -> Candidate {
        let Some(turn) = scan.step.turn else {
            return self.registration(scan).best();
        };
        let alone = Scan {
            step: Step {
                turn: None,
                ..scan.step
            },
            ..*scan
        };
        let refused = self.state.heading;
        let refused = refused.filter(|heading| heading.verdict == Verdict::Refused);
        if let Some(heading) = refused {
            let best = self.registration(&alone).best();
            // After predictions the heading is so uncertain that any turn agrees.
            let is_known = self.state.unmatched == 0
                && best.is_plausible
                && self.gyro.allows_scale(heading.scale);
            if !is_known || self.gate(&best, &turn) != Verdict::Agrees {
                *scan = alone;
                return best;
            }
        }
        let best = self.registration(scan).best();
        // An implausible match gives no evidence.
        let verdict = match best.is_plausible {
            true => self.gate(&best, &turn),
            false => Verdict::Agrees,
        };
        // The match after a wrong match takes the error back.
        let doubted = self.state.heading.map(|heading| heading.verdict) == Some(Verdict::Doubted);
        let is_against = |verdict| match verdict {
            Verdict::Agrees => false,
            Verdict::Doubted => doubted,
            Verdict::Refused => true,
        };
        let refusal = match best.is_plausible && !is_against(verdict) {
            true => None,
            false => self.match_against_gyro(&alone, &turn, is_against),
        };
        if let Some(heading) = &mut self.state.heading {
            heading.verdict = match (refusal.is_some(), verdict) {
                (true, _) => Verdict::Refused,
                (false, Verdict::Agrees) => Verdict::Agrees,
                (false, _) => Verdict::Doubted,
            };
        }
        if refusal.is_some() {
            *scan = alone;
        }
        refusal.unwrap_or(best)
    }

    /// Returns the best match of a scan without the turn of the gyro, if it is certain that it
    /// contradicts that. Otherwise the deskewed points stay with the match before.
    fn match_against_gyro(
        &mut self,
        alone: &Scan<'_>,
        turn: &PredictedTurn,
        is_against: impl Fn(Verdict) -> bool,
    ) -> Option<Candidate> {
        std::mem::swap(&mut self.points, &mut self.other_points);
        let best = self.registration(alone).best();
        let is_certain = best.is_plausible
            && is_against(self.gate(&best, turn))
            && self.is_certain(alone, &best);
        if !is_certain {
            std::mem::swap(&mut self.points, &mut self.other_points);
        }
        is_certain.then_some(best)
    }

    /// Returns whether a match is certain enough to refuse the gyro. The search looks for rotations
    /// near the gyro's, so it need not agree if the scan before has matched.
    fn is_certain(&self, scan: &Scan<'_>, best: &Candidate) -> bool {
        let Some(registered) = self.registered(&best.alignment) else {
            return false;
        };
        let along = self.undetermined(scan, &best.alignment, &registered);
        self.fits_firmly(best)
            && (self.state.unmatched == 0 || self.agrees_with_search(scan, best, along))
    }

    fn gate(&self, best: &Candidate, turn: &PredictedTurn) -> Verdict {
        let registered = self.registered(&best.alignment);
        let both = registered.zip(self.state.heading);
        let jitter_rad = JITTER_DEG.to_radians();
        both.map_or(Verdict::Agrees, |(registered, heading)| {
            heading.gate(&registered, &self.state.pose, turn, jitter_rad)
        })
    }

    /// Returns whether a registered pose contradicts the distance that was predicted by wheels or
    /// Doppler.
    pub(super) fn contradicts_distance(
        &self,
        scan: &Scan<'_>,
        registered: &UncertainMotion,
    ) -> bool {
        let Some(by) = scan.step.distance.map(|it| it.by) else {
            return false;
        };
        let displacement = self.displacement.map(|it| it.ahead);
        let (state, measured, config) = match by {
            DistanceBy::Wheels => (&self.state.wheels, self.aiding.distance, &self.wheels),
            DistanceBy::Doppler => (&self.state.doppler, displacement, &self.doppler_as_wheels),
        };
        let both = state.as_ref().zip(measured);
        both.is_some_and(|(state, measured)| {
            !state.agrees(&measured, &self.driven(registered, config))
        })
    }

    /// Returns the state of each aiding sensor of the distance, its measurement since the scan
    /// before, and its settings.
    fn distances(
        &mut self,
    ) -> [(
        &mut Option<WheelState>,
        Option<WheelDistance>,
        &WheelsConfig,
    ); 2] {
        let displacement = self.displacement.map(|it| it.ahead);
        let distance = self.aiding.distance;
        let state = &mut self.state;
        [
            (&mut state.wheels, distance, &self.wheels),
            (&mut state.doppler, displacement, &self.doppler_as_wheels),
        ]
    }

    /// Hands each aiding sensor of the distance its measurement and the distance driven to a
    /// registered pose.
    pub(super) fn each_distance(
        &mut self,
        registered: &UncertainMotion,
        take: impl Fn(&mut WheelState, Option<&WheelDistance>, &Registered, &WheelsConfig),
    ) {
        let driven =
            [&self.wheels, &self.doppler_as_wheels].map(|config| self.driven(registered, config));
        for ((state, measured, config), driven) in self.distances().into_iter().zip(driven) {
            if let Some(state) = state {
                take(state, measured.as_ref(), &driven, config);
            }
        }
    }

    pub(super) fn propagate_distances(&mut self, scan: &Scan<'_>, predicted: &UncertainMotion) {
        let by = scan.step.distance.map(|it| it.by);
        let sensors = [DistanceBy::Wheels, DistanceBy::Doppler];
        for ((state, measured, _), sensor) in self.distances().into_iter().zip(sensors) {
            let Some(state) = state else {
                continue;
            };
            match measured.filter(|_| by == Some(sensor)) {
                Some(measured) => state.dead_reckon(&measured),
                None => state.inflate(predicted.covariance[(0, 0)]),
            }
            state.add_unmatched(predicted, scan.step.interval_s);
        }
    }

    /// Returns the part along the path of the motion to a registered pose, for the axle in these
    /// settings.
    fn driven(&self, registered: &UncertainMotion, config: &WheelsConfig) -> Registered {
        let motion = UncertainMotion {
            motion: self.state.pose.inv_mul(&registered.motion),
            ..*registered
        };
        let drift_share = uncertainty::drift_share(self.map.len(), &self.config);
        Registered::of(&motion, drift_share, config)
    }

    /// Compares a registered pose with the distances of wheels and Doppler, if there are any: they
    /// slip, or are refused, where it disagrees. Returns false if the predicted one is believed
    /// instead, since the match is not certain.
    pub(super) fn update_distance(
        &mut self,
        scan: &Scan<'_>,
        registered: &UncertainMotion,
        is_certain: bool,
    ) -> bool {
        if !is_certain && self.contradicts_distance(scan, registered) {
            return false;
        }
        self.each_distance(registered, |state, measured, driven, config| {
            state.update(measured, driven, is_certain, config);
        });
        true
    }

    /// Updates the heading by a registered pose. Returns the covariance of a motion to that pose
    /// that has the heading of the filter.
    pub(super) fn update_heading(
        &mut self,
        scan: &Scan<'_>,
        registered: &UncertainMotion,
    ) -> Matrix3<f64> {
        let mut covariance = registered.covariance;
        let Some(heading) = &mut self.state.heading else {
            return covariance;
        };
        let previous = &self.state.pose;
        if let Some(turn) = scan.step.turn {
            let taken_back_rad2 = heading.update(registered, previous, &turn);
            if self.gyro.allows_scale(heading.scale) {
                let drift_share = uncertainty::drift_share(self.map.len(), &self.config);
                covariance = turn.covariance(&covariance, drift_share);
                covariance[(2, 2)] += taken_back_rad2;
                return covariance;
            }
            heading.verdict = Verdict::Refused;
        }
        covariance[(2, 2)] += heading.reset_to(registered, previous);
        covariance
    }
}
