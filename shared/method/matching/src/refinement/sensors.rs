//! The other sensors in a motion: their predictions, and their comparison with the radar's matches.

use gyre_geometry::{
    Pose, UncertainMotion,
    samples::{AllEvidence, Measures, Witness},
    wrap_angle,
};
use nalgebra::{Matrix3, Vector3};

use super::{
    Accepted, Filter, InitialGuess, Outcome, Refiner, SinceMatch, Witnessed,
    candidates::{Candidate, Scan},
    config::JITTER_DEG,
    filter::{GATE, Seen, Verdict},
    predicted::{Measured, PredictedDistance, PredictedTurn, seen_distance},
    tracker::Step,
    uncertainty::with_variance,
};

/// Drift of the radar's heading, rad/√m: 0.03 degrees per square root of 100 m. The trajectories
/// hardly depend on it between 0.01 and 0.1 degrees.
const DRIFT_RAD_PER_SQRT_M: f64 = 5.2e-5;
/// Weight of the newest jump of the heading in the running mean of their squares.
const JUMP_GAIN: f64 = 0.05;
const GYRO: usize = Witness::Gyro as usize;
const DOPPLER: usize = Witness::Doppler as usize;

/// The filter of a kind: an absolute heading belongs to the filter of the heading.
const fn filter_of(kind: Witness) -> usize {
    match kind.row().measures {
        Measures::Turn | Measures::Heading => GYRO,
        Measures::Distance => kind as usize,
    }
}

/// The kinds that measure the distance. Of these the first that is not refused predicts it.
fn distances() -> impl Iterator<Item = Witness> {
    let kinds = Witness::ALL.into_iter();
    kinds.filter(|kind| kind.row().measures == Measures::Distance)
}

impl Refiner {
    /// Predicts the turn and the distance since the scan before by the sensors that have measured
    /// them.
    pub(super) fn predict(&mut self, evidence: [&AllEvidence; 2], interval_s: f64) -> Step {
        self.state.since_match.place_s += interval_s;
        let measured = self.measured(evidence, interval_s);
        for kind in Witness::ALL
            .into_iter()
            .filter(|kind| measured[*kind as usize].is_some())
        {
            let k = filter_of(kind);
            self.state.filters[k].get_or_insert(Filter::new(&self.errors[k]));
        }
        for (filter, errors) in self.state.filters.iter_mut().zip(&self.errors) {
            filter.iter_mut().for_each(|it| it.wait(interval_s, errors));
        }
        let filters = &self.state.filters;
        let predicted = std::array::from_fn(|k| Some(filters[k]?.predict(measured[k].as_ref()?)));
        let predict_turn = || {
            let (predicted, filter, turn) = (predicted[GYRO]?, filters[GYRO]?, measured[GYRO]?);
            let sweep_rate_radps = filter.scale * turn.value[1] - filter.bias;
            Some(PredictedTurn::new(predicted, sweep_rate_radps))
        };
        let predict_distance = |kind: Witness| {
            let (measured, predicted) = (measured[kind as usize]?, &predicted[kind as usize]?);
            let filter = filters[kind as usize].filter(|it| it.verdict != Verdict::Refused)?;
            let side = [filter.scale * measured.value[1], measured.covariance[2]];
            let (ahead_m, since) = (self.radar_ahead_m(kind), &self.state.since_match);
            Some(PredictedDistance::new(
                kind, predicted, side, ahead_m, since,
            ))
        };
        Step {
            interval_s,
            turn: predict_turn(),
            distance: distances().find_map(predict_distance),
            measured,
            predicted,
        }
    }

    fn measured(&self, [earlier, later]: [&AllEvidence; 2], interval_s: f64) -> Measured {
        let config = &self.sensors.doppler;
        let velocities = earlier[DOPPLER].measured().zip(later[DOPPLER].measured());
        let mut measured = later.map(|it| it.measured().copied());
        measured[DOPPLER] = velocities
            .filter(|_| config.is_used())
            .map(|(earlier, later)| config.displacement([earlier, later], interval_s));
        measured
    }

    /// Distance of the radar ahead of the point whose distance a kind measures, m.
    fn radar_ahead_m(&self, kind: Witness) -> f64 {
        match kind {
            Witness::Wheels => self.sensors.wheels.radar_ahead_m,
            _ => 0.0,
        }
    }

    pub(super) fn witnessed(
        &self,
        scan: &Scan<'_>,
        accepted: &Accepted,
    ) -> [Option<Witnessed>; Witness::ALL.len()] {
        Witness::ALL.map(|kind| {
            let measured = scan.step.measured[kind as usize]?;
            let filter = self.state.filters[filter_of(kind)]?;
            Some(match kind.row().measures {
                Measures::Heading => filter.witnessed_heading(measured.value[0]),
                Measures::Turn | Measures::Distance => {
                    let seen = self.seen(kind, &accepted.pose, 0.0);
                    let registered = match accepted.outcome {
                        Outcome::Predicted => 0.0,
                        Outcome::Refined | Outcome::Weak => seen.change,
                    };
                    filter.witnessed(measured.value[0], registered)
                }
            })
        })
    }

    /// Weighs absolute headings against the heading of the filter at a pose of the tracker.
    pub(super) fn observe_headings(&mut self, scan: &Scan<'_>, pose: &Pose) {
        for kind in Witness::ALL {
            let measured = &scan.step.measured[kind as usize];
            if let (Measures::Heading, Some(measured), Some(filter)) =
                (kind.row().measures, measured, self.state.heading_mut())
            {
                filter.observe(measured, pose.rotation.angle());
            }
        }
    }

    /// Returns the best match of a scan. A certain match that contradicts the gyro is the match
    /// without it: the turn is taken off the scan's step. So it is until the gyro agrees again.
    pub(super) fn best_match(&mut self, scan: &mut Scan<'_>) -> Candidate {
        let Some(filter) = self.state.filters[GYRO].filter(|_| scan.step.turn.is_some()) else {
            return self.candidates(scan).best();
        };
        let alone = Scan {
            step: Step {
                turn: None,
                ..scan.step
            },
            ..*scan
        };
        if filter.verdict == Verdict::Refused {
            let best = self.candidates(&alone).best();
            // After predictions the heading is so uncertain that any turn agrees.
            let is_known = self.state.unmatched == 0
                && best.is_plausible
                && filter.is_plausible(&self.errors[GYRO]);
            if !is_known || self.gate_turn(scan, &best) != Verdict::Agrees {
                *scan = alone;
                return best;
            }
        }
        let best = self.candidates(scan).best();
        // An implausible match gives no evidence.
        let verdict = match best.is_plausible {
            true => self.gate_turn(scan, &best),
            false => Verdict::Agrees,
        };
        // The match after a wrong match takes the error back.
        let is_against = |verdict| match verdict {
            Verdict::Agrees => false,
            Verdict::Doubted => filter.verdict == Verdict::Doubted,
            Verdict::Refused => true,
        };
        let refusal = match best.is_plausible && !is_against(verdict) {
            true => None,
            false => self.match_against_gyro(&alone, is_against),
        };
        if let Some(filter) = &mut self.state.filters[GYRO] {
            filter.verdict = match (refusal.is_some(), verdict) {
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
    /// contradicts the turn. Otherwise the deskewed points stay with the match before.
    fn match_against_gyro(
        &mut self,
        alone: &Scan<'_>,
        is_against: impl Fn(Verdict) -> bool,
    ) -> Option<Candidate> {
        std::mem::swap(&mut self.points, &mut self.other_points);
        let best = self.candidates(alone).best();
        let is_certain = best.is_plausible
            && is_against(self.gate_turn(alone, &best))
            && self.is_certain(alone, &best);
        if !is_certain {
            std::mem::swap(&mut self.points, &mut self.other_points);
        }
        is_certain.then_some(best)
    }

    /// Returns whether a match is certain enough to refuse the gyro. The search looks for rotations
    /// near the gyro's, so it need not agree if the scan before has matched.
    fn is_certain(&self, scan: &Scan<'_>, best: &Candidate) -> bool {
        let Some(registered) = self.registered(scan, &best.alignment) else {
            return false;
        };
        let along = self.undetermined(scan, &best.alignment, &registered);
        self.fits_firmly(best)
            && (self.state.unmatched == 0 || self.agrees_with_search(scan, best, along))
    }

    fn gate_turn(&self, scan: &Scan<'_>, best: &Candidate) -> Verdict {
        let registered = self.registered(scan, &best.alignment);
        let verdict = registered.and_then(|registered| {
            let turn = scan.step.predicted[GYRO]?;
            let seen = self.seen(Witness::Gyro, &registered, turn.in_map);
            Some(self.state.filters[GYRO]?.gate(&seen, &turn, JITTER_DEG.to_radians()))
        });
        verdict.unwrap_or_default()
    }

    /// Returns a registered pose in the coordinate of a kind: the heading, near a predicted one, or
    /// the place along the path.
    fn seen(&self, kind: Witness, registered: &UncertainMotion, near_rad: f64) -> Seen {
        let (previous, pose) = (&self.state.pose, &registered.motion);
        if kind.row().measures == Measures::Distance {
            let motion = UncertainMotion {
                motion: previous.inv_mul(pose),
                ..*registered
            };
            return seen_distance(&motion, self.radar_ahead_m(kind), self.drift_share());
        }
        let turn_rad = pose.rotation.angle() - previous.rotation.angle();
        let shift = pose.translation.vector - previous.translation.vector;
        Seen {
            change: near_rad + wrap_angle(turn_rad - near_rad),
            jitter: 0.5 * registered.covariance[(2, 2)],
            drift: DRIFT_RAD_PER_SQRT_M.powi(2) * shift.norm(),
        }
    }

    /// Takes a registered heading. Returns the covariance of a motion to the registered pose that
    /// has the heading of the filter. A gyro with a scale that it cannot have is not used any more.
    pub(super) fn update_heading(
        &mut self,
        scan: &Scan<'_>,
        registered: &UncertainMotion,
        guess: InitialGuess,
    ) -> Matrix3<f64> {
        let mut covariance = registered.covariance;
        let is_place_guessed = guess == InitialGuess::AlongWalls && scan.step.distance.is_none();
        let (near_rad, drift_share) = (scan.step.turn.map(|it| it.yaw_rad()), self.drift_share());
        let seen = self.seen(Witness::Gyro, registered, near_rad.unwrap_or_default());
        if scan.step.turn.is_none() {
            covariance[(2, 2)] += self.jump_rad2(scan, &registered.motion);
        }
        let Some(filter) = &mut self.state.filters[GYRO] else {
            return covariance;
        };
        if let Some(turn) = scan.step.turn {
            if is_place_guessed {
                // Walls that bend turn a scan whose place along them is wrong.
                filter.follow(seen.change, seen.jitter, &turn.of);
                let variance_rad2 = turn.variance_rad2() / drift_share;
                return with_variance(&covariance, Vector3::z(), variance_rad2);
            }
            let taken_back_rad2 = filter.update(&seen, &turn.of);
            if filter.is_plausible(&self.errors[GYRO]) {
                covariance = turn.covariance(&covariance, drift_share);
                covariance[(2, 2)] += taken_back_rad2;
                return covariance;
            }
            filter.verdict = Verdict::Refused;
        }
        covariance[(2, 2)] += filter.reset_to(&seen);
        covariance
    }

    /// Returns the square of a jump of the heading that no sensor has measured, rad², zero of a
    /// turn that a single match can err by, or that is usual: the whole scan can be turned, as by a
    /// slip of the encoder, and the next match then takes the jump back.
    fn jump_rad2(&mut self, scan: &Scan<'_>, pose: &Pose) -> f64 {
        if self.state.anchors[0].is_none_or(|anchor| anchor.age_s > 0.0) {
            return 0.0;
        }
        let [predicted, _] = self.state.predict(&scan.step);
        let jump_rad2 = predicted
            .rotation
            .rotation_to(&pose.rotation)
            .angle()
            .powi(2);
        let usual_rad2 = GATE * self.state.mean_jump_rad2;
        self.state.mean_jump_rad2 += JUMP_GAIN * (jump_rad2 - self.state.mean_jump_rad2);
        match jump_rad2 > usual_rad2.max(JITTER_DEG.to_radians().powi(2)) {
            true => jump_rad2,
            false => 0.0,
        }
    }

    /// Returns whether a registered pose contradicts the predicted distance.
    pub(super) fn contradicts_distance(
        &self,
        scan: &Scan<'_>,
        registered: &UncertainMotion,
    ) -> bool {
        let by = scan.step.distance.map(|it| it.by);
        by.is_some_and(|kind| !self.agrees(kind, scan, &self.seen(kind, registered, 0.0)))
    }

    /// Returns whether a sensor has measured a distance that agrees with a registered place.
    fn agrees(&self, kind: Witness, scan: &Scan<'_>, seen: &Seen) -> bool {
        let both = scan.step.predicted[kind as usize].zip(self.state.filters[kind as usize]);
        both.is_some_and(|(predicted, filter)| {
            filter.gate(seen, &predicted, 0.0) == Verdict::Agrees
        })
    }

    /// Takes a registered place: wheels that disagree with a certain match slip. Returns false if
    /// the predicted distance is believed instead, since the match is not certain.
    pub(super) fn update_distances(
        &mut self,
        scan: &Scan<'_>,
        registered: &UncertainMotion,
        is_certain: bool,
    ) -> bool {
        if !is_certain && self.contradicts_distance(scan, registered) {
            return false;
        }
        for kind in distances() {
            let seen = self.seen(kind, registered, 0.0);
            let predicted = scan.step.predicted[kind as usize];
            let errors = &self.errors[kind as usize];
            if let Some(filter) = &mut self.state.filters[kind as usize] {
                filter.judge(&seen, predicted.as_ref(), is_certain, errors);
            }
        }
        self.state.since_match = SinceMatch::default();
        true
    }

    /// Takes a registered pose whose place along the path is the predicted one, since the map does
    /// not determine it: the map follows the sensors that are used, and a refused sensor that
    /// agrees is used again.
    pub(super) fn follow_distances(&mut self, scan: &Scan<'_>, registered: &UncertainMotion) {
        for kind in distances() {
            // All of the variance of a predicted place accumulates.
            let seen = Seen {
                jitter: 0.0,
                ..self.seen(kind, registered, 0.0)
            };
            let agrees = self.agrees(kind, scan, &seen);
            let predicted = scan.step.predicted[kind as usize];
            let Some((filter, predicted)) =
                self.state.filters[kind as usize].as_mut().zip(predicted)
            else {
                continue;
            };
            match filter.verdict {
                Verdict::Refused if agrees => filter.verdict = Verdict::Agrees,
                Verdict::Refused => {}
                _ => filter.follow(predicted.in_map, predicted.noise, &predicted),
            }
        }
        self.state.since_match.distance_m += self.driven_m(scan);
    }

    /// Takes a predicted pose, and the motion to it.
    pub(super) fn propagate(
        &mut self,
        scan: &Scan<'_>,
        pose: &UncertainMotion,
        motion: &UncertainMotion,
    ) {
        let near_rad = scan.step.turn.map(|it| it.yaw_rad());
        let turn = self.seen(Witness::Gyro, pose, near_rad.unwrap_or_default());
        if let Some(filter) = &mut self.state.filters[GYRO] {
            match &scan.step.turn {
                Some(predicted) => filter.take_prediction(turn.change, &predicted.of),
                None => filter.inflate(pose.covariance[(2, 2)]),
            }
        }
        let by = scan.step.distance.map(|it| it.by);
        let taken_back_m = scan.step.distance.map_or(0.0, |it| it.taken_back_m());
        for kind in distances() {
            let predicted = scan.step.predicted[kind as usize];
            match (&mut self.state.filters[kind as usize], predicted) {
                (Some(filter), Some(predicted)) if by == Some(kind) => {
                    filter.take_prediction(predicted.in_map, &predicted);
                }
                (Some(filter), _) => {
                    // The tracker has moved by so much more than the vehicle.
                    filter.correction -= taken_back_m;
                    filter.inflate(motion.covariance[(0, 0)]);
                }
                (None, _) => {}
            }
        }
        self.state.since_match.distance_m += self.driven_m(scan);
        self.state.since_match.add(motion, scan.step.interval_s);
    }

    /// The distance that predicts a scan's, as measured; zero without one.
    fn driven_m(&self, scan: &Scan<'_>) -> f64 {
        let by = scan.step.distance.map(|it| it.by as usize);
        let measured = by.and_then(|kind| scan.step.measured[kind]);
        measured.map_or(0.0, |measured| measured.value[0])
    }
}
