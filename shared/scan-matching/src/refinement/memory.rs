//! What is remembered from scan to scan besides the map.

use gyre_geometry::{Pose, Twist};
use nalgebra::{Matrix3, Vector3};

use super::{Outcome, RefinementConfig};

/// Share of the newest motion in the velocity, which jitters with each match.
const INERTIA: f64 = 0.5;
/// Share of a new scan in what is usual.
const NEWEST: f64 = 0.2;

/// Where the vehicle is, where it surely was, and what a match usually looks like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackerState {
    /// Pose of the last scan in the first one's frame.
    pub pose: Pose,
    /// The last two refined scans, newest first. The second is there in case the first was wrong after all.
    pub anchors: [Option<Anchor>; 2],
    /// Running mean of the overlap of matched scans.
    pub mean_overlap: f64,
    /// Running mean of the weight of their points.
    pub mean_weight: f64,
    /// Scans in a row that were not refined firmly.
    pub doubtful: u32,
    /// Scans in a row that matched nothing.
    pub unmatched: u32,
}

/// A refined scan, from which the vehicle's way on can be foretold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Anchor {
    /// Its pose in the first scan's frame.
    pub pose: Pose,
    /// Running mean of the velocity there, in the vehicle's frame: m/s, m/s, rad/s.
    pub twist: Twist,
    /// How long ago it was measured, s.
    pub age_s: f64,
}

impl Default for TrackerState {
    fn default() -> Self {
        Self {
            pose: Pose::identity(),
            anchors: [None; 2],
            mean_overlap: 0.0,
            mean_weight: 0.0,
            doubtful: 0,
            unmatched: 0,
        }
    }
}

impl Anchor {
    /// The pose a time later if the velocity stays as it is.
    fn foretell(&self, interval_s: f64) -> Pose {
        self.pose * self.twist.chord_pose_at(self.age_s + interval_s)
    }

    /// The mean velocity on the way to `pose`.
    fn velocity_to(&self, pose: &Pose, interval_s: f64) -> Twist {
        Twist::from_chord(&self.pose.inv_mul(pose), self.age_s + interval_s)
    }

    /// Whether a vehicle can have come from here to `pose`. `firmness` 0 to 1: how far the match may be off besides.
    fn reaches(
        &self,
        pose: &Pose,
        interval_s: f64,
        firmness: f64,
        config: &RefinementConfig,
    ) -> bool {
        let time_s = self.age_s + interval_s;
        let twist = self.velocity_to(pose, interval_s);
        let moved = (twist.linear_mps() - self.twist.linear_mps()) * time_s;
        let turned = (twist.yaw_rate_radps - self.twist.yaw_rate_radps) * time_s;
        let shift = config.jitter_m * firmness + config.acceleration_mps2 * time_s.powi(2);
        let turn = config.jitter_deg * firmness + config.yaw_acceleration_degps2 * time_s.powi(2);
        moved.norm() <= shift && turned.abs() <= turn.to_radians()
    }
}

impl TrackerState {
    /// Where the vehicle is after the interval if nothing changes, once from each anchor; where it was if there is none.
    pub(super) fn foretell(&self, interval_s: f64) -> [Pose; 2] {
        let from = |anchor: &Anchor| anchor.foretell(interval_s);
        let first = self.anchors[0].as_ref().map_or(self.pose, from);
        [first, self.anchors[1].as_ref().map_or(first, from)]
    }

    /// The mean velocity on the way to `pose`, since the vehicle's place was last known for sure.
    pub(super) fn velocity_to(&self, pose: &Pose, interval_s: f64) -> Twist {
        match &self.anchors[0] {
            Some(anchor) => anchor.velocity_to(pose, interval_s),
            None => Twist::from_chord(&self.pose.inv_mul(pose), interval_s),
        }
    }

    /// Whether a vehicle can be at `pose`: on its way from either anchor.
    pub(super) fn allows(
        &self,
        pose: &Pose,
        interval_s: f64,
        firmness: f64,
        config: &RefinementConfig,
    ) -> bool {
        let mut anchors = self.anchors.iter().flatten().peekable();
        anchors.peek().is_none()
            || anchors.any(|anchor| anchor.reaches(pose, interval_s, firmness, config))
    }

    /// Steps on to `pose`.
    pub(super) fn go_on(
        &mut self,
        pose: Pose,
        outcome: Outcome,
        [overlap, weight]: [f64; 2],
        interval_s: f64,
        config: &RefinementConfig,
    ) {
        match outcome {
            Outcome::Refined => self.anchor(pose, interval_s, config),
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
        self.doubtful = if outcome == Outcome::Refined {
            0
        } else {
            self.doubtful + 1
        };
        self.unmatched = if outcome == Outcome::Predicted {
            self.unmatched + 1
        } else {
            0
        };
        self.pose = pose;
    }

    /// Makes `pose` the newest anchor. One that it cannot have come from was wrong and goes.
    fn anchor(&mut self, pose: Pose, interval_s: f64, config: &RefinementConfig) {
        let right = self
            .anchors
            .iter()
            .flatten()
            .find(|anchor| anchor.reaches(&pose, interval_s, 1.0, config))
            .copied();
        let twist = match &right {
            Some(anchor) => anchor
                .twist
                .lerp(&anchor.velocity_to(&pose, interval_s), INERTIA),
            None => self.velocity_to(&pose, interval_s),
        };
        let aged = right.map(|anchor| Anchor {
            age_s: anchor.age_s + interval_s,
            ..anchor
        });
        self.anchors = [
            Some(Anchor {
                pose,
                twist,
                age_s: 0.0,
            }),
            aged,
        ];
    }
}

fn running_mean(mean: f64, value: f64) -> f64 {
    if mean > 0.0 {
        mean + NEWEST * (value - mean)
    } else {
        value
    }
}

/// What is known of a motion that nothing was matched for: that its acceleration was within the limits.
pub(super) fn unmatched_covariance(interval_s: f64, config: &RefinementConfig) -> Matrix3<f64> {
    let spread =
        |jitter: f64, acceleration: f64| (jitter + acceleration * interval_s.powi(2)).powi(2) / 3.0;
    let shift = spread(config.jitter_m, config.acceleration_mps2);
    let turn = spread(
        config.jitter_deg.to_radians(),
        config.yaw_acceleration_degps2.to_radians(),
    );
    Matrix3::from_diagonal(&Vector3::new(shift, shift, turn))
}

#[cfg(test)]
mod tests {
    use gyre_geometry::pose;

    use super::*;

    const INTERVAL_S: f64 = 0.25;

    fn after(poses: &[(f64, f64)]) -> TrackerState {
        let config = RefinementConfig::default();
        let mut memory = TrackerState::default();
        for (x, yaw) in poses {
            let pose = pose(*x, 0.0, *yaw);
            memory.go_on(pose, Outcome::Refined, [0.3, 100.0], INTERVAL_S, &config);
        }
        memory
    }

    #[test]
    fn a_steady_drive_goes_on() {
        let memory = after(&[
            (0.0, 0.0),
            (2.5, 0.0),
            (5.0, 0.0),
            (7.5, 0.0),
            (10.0, 0.0),
            (12.5, 0.0),
            (15.0, 0.0),
        ]);
        let [from_last, from_the_one_before] = memory.foretell(INTERVAL_S);
        assert!((from_last.translation.x - 17.5).abs() < 0.1, "{from_last}");
        assert!(
            (from_the_one_before.translation.x - 17.5).abs() < 0.2,
            "{from_the_one_before}"
        );
    }

    #[test]
    fn no_vehicle_turns_on_the_spot_by_ninety_degrees() {
        let (memory, config) = (
            after(&[(0.0, 0.0), (2.5, 0.0), (5.0, 0.0)]),
            RefinementConfig::default(),
        );
        let at = |x: f64, yaw: f64| memory.allows(&pose(x, 0.0, yaw), INTERVAL_S, 1.0, &config);
        assert!(at(7.5, 0.0) && at(7.2, 0.1));
        assert!(!at(7.5, std::f64::consts::FRAC_PI_2) && !at(30.0, 0.0));
    }

    #[test]
    fn an_anchor_that_was_wrong_is_left_behind() {
        let mut memory = after(&[(0.0, 0.0), (2.5, 0.0), (5.0, 0.0), (7.5, 0.0), (10.0, 0.0)]);
        let config = RefinementConfig::default();
        let mut step = |x: f64, yaw: f64| {
            let pose = pose(x, 0.0, yaw);
            let allowed = memory.allows(&pose, INTERVAL_S, 1.0, &config);
            memory.go_on(pose, Outcome::Refined, [0.3, 100.0], INTERVAL_S, &config);
            allowed
        };
        assert!(step(12.4, 0.14), "eight degrees at once are just possible");
        assert!(
            step(15.0, -0.01),
            "but not there and back: it goes on from the anchor before"
        );
        assert!(step(17.5, 0.0));
        let velocity = memory.anchors[0]
            .map(|anchor| anchor.twist.yaw_rate_radps.abs())
            .unwrap_or(9.0);
        assert!(velocity < 0.1, "{velocity} rad/s");
    }
}
