//! Gyro and wheels as witnesses of a motion: against what the radar says of it.

use gyre_geometry::UncertainMotion;

use super::{
    Heading, Refiner, WheelState,
    heading::{PredictedTurn, Verdict},
    registration::{Candidate, Scan},
    tracker::Step,
    uncertainty,
    wheels::{PredictedDistance, Registered},
};

impl Refiner {
    /// Predicts the turn since the scan before by the gyro, if that has measured it.
    pub(super) fn predict_turn(&mut self, interval_s: f64) -> Option<PredictedTurn> {
        let Some(turn) = self.turn else {
            let heading = self.state.heading.iter_mut();
            heading.for_each(|heading| heading.wait(interval_s, &self.gyro));
            return None;
        };
        let heading = self.state.heading.get_or_insert(Heading::new(&self.gyro));
        Some(heading.predict(&turn, &self.gyro))
    }

    /// Predicts the distance since the scan before by the wheels, if those have measured it and do
    /// not slip.
    pub(super) fn predict_distance(&mut self, interval_s: f64) -> Option<PredictedDistance> {
        let measured = self.distance;
        if measured.is_some() {
            self.state
                .wheels
                .get_or_insert(WheelState::new(&self.wheels));
        }
        let wheels = self.state.wheels.as_mut()?;
        wheels.wait(interval_s, &self.wheels);
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
        let last = self.state.heading.map(|heading| heading.verdict);
        if last == Some(Verdict::Refused) {
            let best = self.registration(&alone).best();
            // After predictions the heading is so uncertain that any turn agrees.
            let is_known = self.state.unmatched == 0 && best.is_plausible;
            if !is_known || self.judge(&best, &turn) != Verdict::Agrees {
                *scan = alone;
                return best;
            }
        }
        let best = self.registration(scan).best();
        // A match that is not plausible says nothing.
        let verdict = match best.is_plausible {
            true => self.judge(&best, &turn),
            false => Verdict::Agrees,
        };
        let refusal = match best.is_plausible && verdict != Verdict::Refused {
            true => None,
            false => self.match_against_gyro(&alone, &turn),
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
    /// contradicts that. Otherwise the deskewed points stay those of the match before.
    fn match_against_gyro(&mut self, alone: &Scan<'_>, turn: &PredictedTurn) -> Option<Candidate> {
        std::mem::swap(&mut self.points, &mut self.other_points);
        let best = self.registration(alone).best();
        let is_certain = best.is_plausible
            && self.judge(&best, turn) == Verdict::Refused
            && self.is_certain(alone, &best);
        if !is_certain {
            std::mem::swap(&mut self.points, &mut self.other_points);
        }
        is_certain.then_some(best)
    }

    /// Returns whether a match is certain enough to refuse the gyro. The search looks for rotations
    /// near that of the gyro alone, so it need not agree where the scan before has matched.
    fn is_certain(&self, scan: &Scan<'_>, best: &Candidate) -> bool {
        let Some(registered) = self.registered(&best.alignment) else {
            return false;
        };
        let along = self.undetermined(scan, &best.alignment, &registered);
        self.fits_firmly(best)
            && (self.state.unmatched == 0 || self.agrees_with_search(scan, best, along))
    }

    /// Returns what the heading of a match says of that of the gyro.
    fn judge(&self, best: &Candidate, turn: &PredictedTurn) -> Verdict {
        let registered = self.registered(&best.alignment);
        let both = registered.zip(self.state.heading);
        let jitter_rad = self.config.jitter_deg.to_radians();
        both.map_or(Verdict::Agrees, |(registered, heading)| {
            heading.judge(&registered, &self.state.pose, turn, jitter_rad)
        })
    }

    /// Returns the part along the path of the motion to a registered pose.
    pub(super) fn driven(&self, registered: &UncertainMotion) -> Registered {
        let motion = UncertainMotion {
            motion: self.state.pose.inv_mul(&registered.motion),
            ..*registered
        };
        let drift_share = uncertainty::drift_share(self.map.len(), &self.config);
        Registered::of(&motion, drift_share, &self.wheels)
    }

    /// Compares a registered pose with the distance of the wheels, if there is one: they slip where
    /// it disagrees. Returns false if they are believed instead, since the match is not certain.
    pub(super) fn weigh_distance(
        &mut self,
        scan: &Scan<'_>,
        registered: &UncertainMotion,
        is_certain: bool,
    ) -> bool {
        let registered = self.driven(registered);
        let Some(wheels) = &mut self.state.wheels else {
            return true;
        };
        match &self.distance {
            Some(measured) if wheels.agrees(measured, &registered) => {
                wheels.correct(measured, &registered);
            }
            Some(_) if scan.step.distance.is_some() && !is_certain => return false,
            measured => {
                let slips = measured.is_some() || wheels.slips;
                wheels.adopt(&registered, slips);
            }
        }
        true
    }

    /// Weighs the heading of a registered pose against that of the gyro, if there is one.
    pub(super) fn with_gyro_heading(
        &mut self,
        scan: &Scan<'_>,
        registered: UncertainMotion,
    ) -> UncertainMotion {
        let Some(heading) = &mut self.state.heading else {
            return registered;
        };
        let Some(turn) = scan.step.turn else {
            return heading.adopt(&registered, &self.state.pose);
        };
        let drift_share = uncertainty::drift_share(self.map.len(), &self.config);
        heading.weigh(&registered, &self.state.pose, &turn, drift_share)
    }
}
