//! The state kept from scan to scan: the last poses, the predictions from them, and how well scans
//! match on average.

use gyre_geometry::{
    Pose, Twist,
    samples::{Measures, Witness},
};
use nalgebra::{Matrix3, UnitComplex, Vector2};
use serde::{Deserialize, Serialize};

use super::{
    Filter, Outcome, RefinementConfig, SinceMatch, Standstill,
    config::{JITTER_DEG, JITTER_M},
    filter::Predicted,
    predicted::{Measured, PredictedDistance, PredictedTurn},
};

/// Weight of the newest velocity, which jitters with each match, in its running mean.
const TWIST_GAIN: f64 = 0.5;
/// Weight of the newest scan in the running means of overlap and weight.
const FIT_GAIN: f64 = 0.2;

#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct TrackerState {
    pub pose: Pose,
    /// The last two refined scans, newest first. The second one is used if the first turns out to
    /// be wrong.
    pub anchors: [Option<Anchor>; 2],
    pub mean_overlap: f64,
    pub mean_weight: f64,
    pub doubtful: u32,
    pub unmatched: u32,
    /// Number of scans in a row, but for predicted ones, whose place along walls without structure
    /// was the predicted one.
    pub along_walls: u32,
    /// Number of the last of these at constant velocity, whose distance is unknown.
    pub sliding: u32,
    /// Displacement by the search beyond such guesses, m, along the axes of the map.
    pub ahead_m: Vector2<f64>,
    pub standstill: Standstill,
    /// Running mean of the squares of what registered and predicted heading are apart, rad².
    pub mean_jump_rad2: f64,
    /// The bias and the scale of each sensor, and the like, in the order of [`Witness::ALL`];
    /// `None` until it has measured something.
    pub filters: [Option<Filter>; Witness::ALL.len()],
    pub since_match: SinceMatch,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Step {
    pub interval_s: f64,
    pub turn: Option<PredictedTurn>,
    /// The distance since then, by wheels that do not slip, or by Doppler.
    pub distance: Option<PredictedDistance>,
    pub measured: Measured,
    pub predicted: [Option<Predicted>; Witness::ALL.len()],
}

impl Step {
    pub fn moves(&self) -> bool {
        self.distance.is_some_and(|it| it.is_certain())
            || self.turn.is_some_and(|it| it.is_certain())
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Anchor {
    pub pose: Pose,
    pub twist: Twist,
    pub age_s: f64,
}

impl Anchor {
    /// The pose after the interval at constant velocity, with the heading of the gyro if known.
    fn predict(&self, interval_s: f64, heading: Option<UnitComplex<f64>>) -> Pose {
        let time_s = self.age_s + interval_s;
        let Some(heading) = heading else {
            return self.pose * self.twist.chord_pose_at(time_s);
        };
        let twist = Twist {
            yaw_rate_radps: self.pose.rotation.rotation_to(&heading).angle() / time_s,
            ..self.twist
        };
        self.pose * twist.chord_pose_at(time_s)
    }

    fn twist_to(&self, pose: &Pose, interval_s: f64) -> Twist {
        Twist::from_chord(&self.pose.inv_mul(pose), self.age_s + interval_s)
    }

    /// Returns whether a vehicle can have come from here to `pose`: within the limits of
    /// acceleration, and `jitter_share` (0 to 1) of the jitter of a match.
    fn can_reach(
        &self,
        pose: &Pose,
        interval_s: f64,
        heading: Option<UnitComplex<f64>>,
        jitter_share: f64,
        config: &RefinementConfig,
    ) -> bool {
        let time_s = self.age_s + interval_s;
        let twist = self.twist_to(pose, interval_s);
        let moved = (twist.linear_mps() - self.twist.linear_mps()) * time_s;
        let turned = (twist.yaw_rate_radps - self.twist.yaw_rate_radps) * time_s;
        let shift = JITTER_M * jitter_share + config.acceleration_mps2 * time_s.powi(2);
        let jitter = JITTER_DEG * jitter_share;
        let (turned, turn) = match heading {
            Some(heading) => (heading.rotation_to(&pose.rotation).angle(), jitter),
            None => (
                turned,
                jitter + config.yaw_acceleration_degps2 * time_s.powi(2),
            ),
        };
        moved.norm() <= shift && turned.abs() <= turn.to_radians()
    }
}

impl TrackerState {
    /// The filter of the heading, if a gyro has measured a turn, or another sensor the heading.
    pub(super) fn heading_mut(&mut self) -> Option<&mut Filter> {
        self.filters[Witness::Gyro as usize].as_mut()
    }

    /// Returns whether a sensor has measured a distance.
    pub(super) fn has_distance(&self) -> bool {
        let kinds = Witness::ALL.into_iter().zip(&self.filters);
        let mut distances = kinds.filter(|(kind, _)| kind.row().measures == Measures::Distance);
        distances.any(|(_, filter)| filter.is_some())
    }

    /// The poses after the interval at constant velocity, predicted from each anchor; the last pose
    /// without an anchor. With wheels or Doppler, the distance from the last pose to the first is
    /// the measured one.
    pub(super) fn predict(&self, step: &Step) -> [Pose; 2] {
        let heading = self.heading_at(step);
        let from = |anchor: &Anchor| anchor.predict(step.interval_s, heading);
        let first = self.anchors[0].as_ref().map_or(self.pose, from);
        let second = self.anchors[1].as_ref().map_or(first, from);
        let Some(distance) = &step.distance else {
            return [first, second];
        };
        let yaw_rad = self.pose.rotation.rotation_to(&first.rotation).angle();
        [self.pose * distance.motion([yaw_rad, 0.0]).motion, second]
    }

    pub(super) fn predicted_turn_rad(&self, step: &Step) -> f64 {
        let [predicted, _] = self.predict(step);
        self.pose.rotation.rotation_to(&predicted.rotation).angle()
    }

    fn heading_at(&self, step: &Step) -> Option<UnitComplex<f64>> {
        let turn = step.turn?;
        Some(self.pose.rotation * UnitComplex::new(turn.yaw_rad()))
    }

    /// The velocity during a scan at `pose`: the mean since the newest anchor, or since the last
    /// pose without an anchor; with a gyro, its yaw rate.
    pub(super) fn twist_to(&self, pose: &Pose, step: &Step) -> Twist {
        let mean = self.mean_twist_to(pose, step.interval_s);
        Twist {
            yaw_rate_radps: step
                .turn
                .map_or(mean.yaw_rate_radps, |turn| turn.sweep_rate_radps),
            ..mean
        }
    }

    fn mean_twist_to(&self, pose: &Pose, interval_s: f64) -> Twist {
        match &self.anchors[0] {
            Some(anchor) => anchor.twist_to(pose, interval_s),
            None => Twist::from_chord(&self.pose.inv_mul(pose), interval_s),
        }
    }

    pub(super) fn can_reach(
        &self,
        pose: &Pose,
        step: &Step,
        jitter_share: f64,
        config: &RefinementConfig,
    ) -> bool {
        let (interval_s, heading) = (step.interval_s, self.heading_at(step));
        let mut anchors = self.anchors.iter().flatten().peekable();
        anchors.peek().is_none()
            || anchors
                .any(|anchor| anchor.can_reach(pose, interval_s, heading, jitter_share, config))
    }

    /// Leaves the map: a new one starts with the last scan, or a later one. If wheels have led to
    /// that, the scans of the map do not constrain the vehicle's position any more.
    pub(super) fn leave_map(&mut self) {
        let filters = self.filters.iter_mut().flatten();
        filters.for_each(Filter::start_map);
        self.since_match.covariance = Matrix3::zeros();
        if self.anchors[0].is_some_and(|anchor| anchor.age_s == 0.0) {
            self.anchors[1] = None;
        }
    }

    pub(super) fn update(
        &mut self,
        pose: Pose,
        outcome: Outcome,
        [overlap, weight]: [f64; 2],
        step: &Step,
        config: &RefinementConfig,
    ) {
        let interval_s = step.interval_s;
        match outcome {
            Outcome::Refined => self.push_anchor(pose, step, config),
            Outcome::Predicted if step.distance.is_some() => self.move_anchor(pose, step),
            _ => self
                .anchors
                .iter_mut()
                .flatten()
                .for_each(|anchor| anchor.age_s += interval_s),
        }
        if outcome != Outcome::Predicted {
            self.mean_overlap = running_mean(self.mean_overlap, overlap);
            self.mean_weight = running_mean(self.mean_weight, weight);
        }
        self.doubtful = match outcome {
            Outcome::Refined => 0,
            _ => self.doubtful.saturating_add(1),
        };
        self.unmatched = match outcome {
            Outcome::Predicted => self.unmatched.saturating_add(1),
            _ => 0,
        };
        self.pose = pose;
    }

    /// Makes `pose`, predicted by wheels, the newest anchor. The last refined scan stays behind it,
    /// in case they slip meanwhile.
    fn move_anchor(&mut self, pose: Pose, step: &Step) {
        let interval_s = step.interval_s;
        let twist = self.mean_twist_to(&pose, interval_s);
        let [first, second] = self.anchors;
        let refined = if self.unmatched == 0 { first } else { second };
        self.set_anchors(pose, twist, refined, interval_s);
    }

    fn set_anchors(&mut self, pose: Pose, twist: Twist, second: Option<Anchor>, interval_s: f64) {
        let age_s = 0.0;
        let newest = Anchor { pose, twist, age_s };
        let aged = second.map(|anchor| Anchor {
            age_s: anchor.age_s + interval_s,
            ..anchor
        });
        self.anchors = [Some(newest), aged];
    }

    /// Makes `pose` the newest anchor. An anchor is wrong and dropped if `pose` is out of its
    /// reach.
    fn push_anchor(&mut self, pose: Pose, step: &Step, config: &RefinementConfig) {
        let (interval_s, heading) = (step.interval_s, self.heading_at(step));
        let valid = self
            .anchors
            .iter()
            .flatten()
            .find(|anchor| anchor.can_reach(&pose, interval_s, heading, 1.0, config))
            .copied();
        let twist = match &valid {
            Some(anchor) => anchor
                .twist
                .lerp(&anchor.twist_to(&pose, interval_s), TWIST_GAIN),
            None => self.mean_twist_to(&pose, interval_s),
        };
        self.set_anchors(pose, twist, valid, interval_s);
    }
}

fn running_mean(mean: f64, value: f64) -> f64 {
    if mean > 0.0 {
        mean + FIT_GAIN * (value - mean)
    } else {
        value
    }
}

#[cfg(test)]
mod tests {
    use gyre_geometry::pose;

    use super::*;

    const STEP: Step = Step {
        interval_s: 0.25,
        turn: None,
        distance: None,
        measured: [None; Witness::ALL.len()],
        predicted: [None; Witness::ALL.len()],
    };

    fn after(poses: &[(f64, f64)]) -> TrackerState {
        let config = RefinementConfig::default();
        let mut state = TrackerState::default();
        for (x, yaw) in poses {
            let pose = pose(*x, 0.0, *yaw);
            state.update(pose, Outcome::Refined, [0.3, 100.0], &STEP, &config);
        }
        state
    }

    #[test]
    fn a_turn_by_ninety_degrees_on_the_spot_is_not_reachable() {
        let (state, config) = (
            after(&[(0.0, 0.0), (2.5, 0.0), (5.0, 0.0)]),
            RefinementConfig::default(),
        );
        let at = |x: f64, yaw: f64| state.can_reach(&pose(x, 0.0, yaw), &STEP, 1.0, &config);
        assert!(at(7.5, 0.0) && at(7.2, 0.1));
        assert!(!at(7.5, std::f64::consts::FRAC_PI_2) && !at(30.0, 0.0));
    }

    #[test]
    fn a_wrong_anchor_is_dropped() {
        let mut state = after(&[(0.0, 0.0), (2.5, 0.0), (5.0, 0.0), (7.5, 0.0), (10.0, 0.0)]);
        let config = RefinementConfig::default();
        let mut step = |x: f64, yaw: f64| {
            let pose = pose(x, 0.0, yaw);
            let allowed = state.can_reach(&pose, &STEP, 1.0, &config);
            state.update(pose, Outcome::Refined, [0.3, 100.0], &STEP, &config);
            allowed
        };
        assert!(step(12.4, 0.14), "eight degrees at once are just possible");
        assert!(
            step(15.0, -0.01),
            "but not there and back: predicted from the second anchor"
        );
        assert!(step(17.5, 0.0));
        let velocity = state.anchors[0]
            .map(|anchor| anchor.twist.yaw_rate_radps.abs())
            .unwrap_or(9.0);
        assert!(velocity < 0.1, "{velocity} rad/s");
    }
}
