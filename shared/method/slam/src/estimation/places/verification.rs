use std::f64::consts::PI;

use gyre_geometry::{UncertainMotion, pose, wrap_angle};
use gyre_matching::Submap;

use super::{Candidate, Registrar};

const MIN_CORRELATION: f64 = 0.65;
/// Smallest difference of the correlations of an accepted loop and of any other motion between the
/// two places.
const MIN_MARGIN: f64 = 0.1;
/// A match on whole cells at an angle of the descriptors' grid is this much below the final one at
/// most.
const COARSE_LOSS: f64 = 0.15;

#[derive(Clone, Debug, PartialEq)]
pub struct LoopCandidate {
    pub place: usize,
    pub similarity: f64,
    /// The pose of the queried keyframe in the frame of the found one, with its covariance; a
    /// covariance of zero if the two were not aligned.
    pub motion: UncertainMotion,
    /// Masked correlation of the submaps at the motion; the search's correlation without an
    /// alignment.
    pub correlation: f64,
    /// Correlation on whole cells at the candidate's angle, of the best translation and of the
    /// runner-up: another translation, or the best at the other angle. Their difference is the
    /// margin.
    pub searched: f64,
    pub runner_up: f64,
    /// Chi-square of the motion against the odometry, with three degrees of freedom; NaN if it was
    /// rejected before.
    pub chi_square: f64,
    pub outcome: LoopOutcome,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LoopOutcome {
    /// The two submaps show the same place.
    Accepted,
    /// The correlation is below 0.65.
    LowCorrelation,
    /// Another motion correlates nearly as well: less than 0.1 below.
    Ambiguous,
    Undetermined,
    /// The motion contradicts the odometry between the two keyframes.
    ContradictsOdometry,
}

impl Registrar {
    /// Verifies a candidate: registers the submap of the query, `later`, with the submap of the
    /// candidate, `earlier`.
    pub fn verify(
        &mut self,
        later: &Submap,
        earlier: &Submap,
        candidate: &Candidate,
    ) -> LoopCandidate {
        self.set_later(later);
        self.set_earlier(earlier);
        let [straight, turned] =
            [0.0, PI].map(|turn| self.search(wrap_angle(candidate.yaw_rad + turn), None));
        let (best, other) = match turned.score > straight.score {
            true => (turned, straight),
            false => (straight, turned),
        };
        let second = best.runner_up.map_or(0.0, |second| second.score);
        let searched = pose(best.x_m, best.y_m, best.yaw_rad);
        let mut found = LoopCandidate {
            place: candidate.place,
            similarity: candidate.score,
            motion: UncertainMotion {
                motion: searched,
                ..UncertainMotion::identity()
            },
            correlation: best.score,
            searched: best.score,
            runner_up: second.max(other.score),
            chi_square: f64::NAN,
            outcome: LoopOutcome::LowCorrelation,
        };
        if best.score < MIN_CORRELATION - COARSE_LOSS {
            return found;
        }
        match self.aligner.align(later, earlier, false, &searched) {
            Some(motion) => {
                found.motion = motion;
                found.correlation = self.correlation(&motion.motion, None);
                found.outcome = judge(&found);
            }
            None => found.outcome = LoopOutcome::Undetermined,
        }
        found
    }
}

fn judge(found: &LoopCandidate) -> LoopOutcome {
    if found.correlation < MIN_CORRELATION {
        LoopOutcome::LowCorrelation
    } else if found.searched - found.runner_up < MIN_MARGIN {
        LoopOutcome::Ambiguous
    } else {
        LoopOutcome::Accepted
    }
}
