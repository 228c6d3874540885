//! Association of reported motions with the ground truth at their stamps.

use std::ops::Range;

use gyre_geometry::{ComposedMotion, OdometryMotion, Pose, UncertainMotion, xy_yaw};
use gyre_radar::Trajectory;

use crate::evaluation::{
    EvaluationError,
    associate::{At, pose_at, require_stamps},
    error::{ESTIMATE, TRUTH},
    matched::require_poses,
};

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimedMotion {
    pub from_ns: i64,
    pub to_ns: i64,
    pub estimate: OdometryMotion,
}

/// Returns the motions that start within a part of the drive, by shares of its duration; `motions`
/// are in order of time. Adjoining parts share no motion and leave none out. Covariances are
/// calibrated on one part and tested on another.
pub fn part<'m>(motions: &'m [TimedMotion], shares: &Range<f64>) -> &'m [TimedMotion] {
    let (Some(first), Some(last)) = (motions.first(), motions.last()) else {
        return motions;
    };
    let duration_ns = last.to_ns.saturating_sub(first.from_ns) as f64;
    let before = |share: f64| {
        motions.partition_point(|motion| {
            (motion.from_ns.saturating_sub(first.from_ns) as f64) < share * duration_ns
        })
    };
    // Motions out of order have no parts: `MatchedMotions::new` refuses them.
    motions
        .get(before(shares.start)..before(shares.end))
        .unwrap_or(motions)
}

/// Motions in unbroken chains, with the ground truth at their stamps.
#[derive(Debug, Clone, PartialEq)]
pub struct MatchedMotions {
    pub(crate) chains: Vec<Chain>,
    pub motions: usize,
    pub without_truth: usize,
    /// Motions without a positive definite covariance: left out, and the chain ends there.
    pub without_covariance: usize,
}

/// `n` consecutive motions and their `n + 1` nodes.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Chain {
    pub motions: Vec<OdometryMotion>,
    pub stamps_ns: Vec<i64>,
    pub truth: Vec<Option<Pose>>,
}

impl MatchedMotions {
    /// Associates both ends of each motion with the ground truth, interpolated across gaps of up to
    /// `max_gap_ns`.
    pub fn new(
        motions: &[TimedMotion],
        truth: &Trajectory,
        max_gap_ns: i64,
    ) -> Result<Self, EvaluationError> {
        require_poses(TRUTH, &truth.poses)?;
        require_stamps(TRUTH, truth)?;
        require_motions(motions)?;
        let at = |stamp_ns| match pose_at(truth, stamp_ns, max_gap_ns) {
            At::Pose(pose) => Some(pose),
            At::Outside | At::Gap => None,
        };
        let mut matched = Self {
            chains: Vec::new(),
            motions: motions.len(),
            without_truth: 0,
            without_covariance: 0,
        };
        for motion in motions {
            let (from, to) = (at(motion.from_ns), at(motion.to_ns));
            matched.without_truth += usize::from(from.is_none() || to.is_none());
            match motion.estimate.alone().has_covariance() {
                true => matched.add(motion, from, to),
                false => matched.without_covariance += 1,
            }
        }
        matched.require_some()
    }

    /// Adds a motion to the last chain if it starts where that ends, else to a new one.
    fn add(&mut self, motion: &TimedMotion, from: Option<Pose>, to: Option<Pose>) {
        let follows = |chain: &&mut Chain| chain.stamps_ns.last() == Some(&motion.from_ns);
        match self.chains.last_mut().filter(follows) {
            Some(chain) => {
                chain.motions.push(motion.estimate);
                chain.stamps_ns.push(motion.to_ns);
                chain.truth.push(to);
            }
            None => self.chains.push(Chain {
                motions: vec![motion.estimate],
                stamps_ns: vec![motion.from_ns, motion.to_ns],
                truth: vec![from, to],
            }),
        }
    }

    fn require_some(self) -> Result<Self, EvaluationError> {
        let mut ends = self.chains.iter().flat_map(|chain| chain.truth.windows(2));
        match ends.any(|w| w[0].is_some() && w[1].is_some()) {
            true => Ok(self),
            false => Err(EvaluationError(format!(
                "none of {} motions has ground truth and covariance: {} without ground truth at both ends (same clock?), {} without a positive definite covariance",
                self.motions, self.without_truth, self.without_covariance
            ))),
        }
    }

    /// Returns the first and last stamp of the chains, ns.
    pub(crate) fn span_ns(&self) -> (i64, i64) {
        let mut stamps = self.chains.iter().flat_map(|chain| &chain.stamps_ns);
        let first = stamps.next().copied().unwrap_or_default();
        (first, stamps.last().copied().unwrap_or(first))
    }
}

impl Chain {
    pub fn composed(&self, first: usize) -> impl Iterator<Item = UncertainMotion> + '_ {
        self.motions[first..]
            .iter()
            .scan(None, |so_far: &mut Option<ComposedMotion>, motion| {
                let next = match so_far {
                    None => ComposedMotion::of(motion),
                    Some(composed) => composed.then(motion),
                };
                *so_far = Some(next);
                Some(next.motion)
            })
    }

    /// Returns the true motion between two nodes that both have ground truth.
    pub fn true_motion(&self, first: usize, last: usize) -> Option<Pose> {
        Some(self.truth[first]?.inv_mul(&self.truth[last]?))
    }
}

fn require_motions(motions: &[TimedMotion]) -> Result<(), EvaluationError> {
    let mut previous_ns = motions.first().map_or(0, |first| first.from_ns);
    for (index, motion) in motions.iter().enumerate() {
        let TimedMotion { from_ns, to_ns, .. } = *motion;
        let motion = motion.estimate.motion;
        if require_poses(ESTIMATE, &[motion]).is_err() {
            let [x_m, y_m, yaw_rad] = xy_yaw(&motion);
            return Err(EvaluationError(format!(
                "motion {index} is invalid: ({x_m} m, {y_m} m, {yaw_rad} rad)"
            )));
        }
        if from_ns < previous_ns || to_ns <= from_ns {
            return Err(EvaluationError(format!(
                "motion {index} is out of order: from {from_ns} ns to {to_ns} ns, after {previous_ns} ns"
            )));
        }
        previous_ns = to_ns;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix3;

    use super::*;
    use gyre_geometry::pose;

    const MS: i64 = 1_000_000;

    fn motion(from_ms: i64, to_ms: i64, variance: f64) -> TimedMotion {
        let estimate = UncertainMotion {
            motion: pose(1.0, 0.0, 0.0),
            covariance: Matrix3::identity() * variance,
        };
        TimedMotion {
            from_ns: from_ms * MS,
            to_ns: to_ms * MS,
            estimate: OdometryMotion::independent(estimate),
        }
    }

    /// Matches with a ground truth that is at x = t at t ms, interpolated across up to 20 ms.
    fn matched(
        motions: &[TimedMotion],
        truth_ms: &[i64],
    ) -> Result<MatchedMotions, EvaluationError> {
        let at = |&t: &i64| pose(t as f64, 0.0, 0.0);
        let stamps = truth_ms.iter().map(|t| t * MS).collect();
        let truth = Trajectory::timed(stamps, truth_ms.iter().map(at).collect());
        MatchedMotions::new(motions, &truth, 20 * MS)
    }

    #[test]
    fn chains_end_at_gaps_and_at_motions_without_covariance() {
        let motions = [
            motion(0, 10, 1.0),
            motion(10, 20, 1.0),
            motion(30, 40, 1.0),
            motion(40, 50, 0.0),
            motion(50, 60, 1.0),
        ];
        let found = matched(&motions, &[0, 20, 40, 60]).unwrap();
        let in_ms = |chain: &Chain| chain.stamps_ns.iter().map(|t| t / MS).collect();
        let stamps: Vec<Vec<i64>> = found.chains.iter().map(in_ms).collect();
        assert_eq!(stamps, [vec![0, 10, 20], vec![30, 40], vec![50, 60]]);
        let counts = (found.motions, found.without_truth, found.without_covariance);
        assert_eq!(counts, (5, 0, 1));
        assert_eq!(found.span_ns(), (0, 60 * MS));
    }

    #[test]
    fn a_chain_continues_across_a_gap_of_the_ground_truth() {
        let motions = [0, 10, 20, 30].map(|t| motion(t, t + 10, 1.0));
        let found = matched(&motions, &[0, 10, 40]).unwrap();
        assert_eq!((found.chains.len(), found.without_truth), (1, 3));
        let whole = found.chains[0].true_motion(0, 4);
        assert_eq!(whole, Some(pose(40.0, 0.0, 0.0)));
        assert_eq!(found.chains[0].true_motion(1, 2), None);
    }

    #[test]
    fn adjoining_parts_share_no_motion_and_leave_none_out() {
        let motions = [0, 10, 20, 30, 45].map(|t| motion(t, t + 10, 1.0));
        let of = |from, to| part(&motions, &(from..to));
        assert_eq!((of(0.0, 0.5), of(0.5, 1.0)), motions.split_at(3));
        assert_eq!(of(0.0, 1.0), motions);
        assert!(of(0.4, 0.5).is_empty());
    }

    #[test]
    fn motions_that_cannot_be_matched_are_refused_with_the_reason() {
        let mut broken = motion(0, 10, 1.0);
        broken.estimate.motion.translation.x = f64::NAN;
        let unmatched = [motion(0, 10, 0.0), motion(100, 110, 1.0)];
        for (motions, words) in [
            (&unmatched[..], "none of 2 motions"),
            (&unmatched, ": 1 without ground truth"),
            (&unmatched, "(same clock?), 1 without"),
            (&[], "none of 0 motions"),
            (&[motion(0, 10, 1.0), motion(9, 19, 1.0)], "motion 1 is out"),
            (&[broken], "motion 0 is invalid"),
        ] {
            let refused = matched(motions, &[0, 10]).unwrap_err().0;
            assert!(refused.contains(words), "{refused}");
        }
    }
}
