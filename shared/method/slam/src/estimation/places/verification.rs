use std::f64::consts::PI;

use gyre_geometry::{UncertainMotion, pose, wrap_angle};
use gyre_matching::{RefinementConfig, SettingError, Submap};

use super::{Candidate, Registrar};

const MIN_CORRELATION: f64 = 0.65;
/// Smallest difference of the correlations of an accepted loop and of any other motion between the
/// two places.
const MIN_MARGIN: f64 = 0.1;
/// A match on whole cells at an angle of the descriptors' grid is this much below the final one at
/// most.
const COARSE_LOSS: f64 = 0.15;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VerificationOutcome {
    /// The two submaps show the same place.
    Accepted,
    /// The correlation is below 0.65.
    LowCorrelation,
    /// Another motion correlates nearly as well: less than 0.1 below.
    Ambiguous,
    Undetermined,
    /// The motion contradicts the odometry between the two keyframes, which the verifier does not
    /// know.
    ContradictsOdometry,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Verification {
    pub outcome: VerificationOutcome,
    /// The pose of the queried keyframe in the frame of the found one, with its covariance; only as
    /// searched, with a covariance of zero, if the outcome is `LowCorrelation` before the
    /// alignment, or `Undetermined`.
    pub motion: UncertainMotion,
    /// Masked correlation of the submaps at the motion; the search's correlation without an
    /// alignment.
    pub correlation: f64,
    /// Correlation on whole cells at the candidate's angle, of the best translation and of the
    /// runner-up: another translation, or the best at the other angle. Their difference is the
    /// margin.
    pub searched: f64,
    pub runner_up: f64,
    /// The yaw differs from the candidate's by half a turn.
    pub half_turn: bool,
}

pub struct LoopVerifier(Registrar);

impl LoopVerifier {
    pub fn new(refinement: &RefinementConfig, capacity: usize) -> Result<Self, SettingError> {
        Ok(Self(Registrar::new(refinement, capacity)?))
    }

    /// Registers the submap of the query, `later`, with the submap of the candidate, `earlier`.
    pub fn verify(
        &mut self,
        later: &Submap,
        earlier: &Submap,
        candidate: &Candidate,
    ) -> Verification {
        let registrar = &mut self.0;
        registrar.set_later(later);
        registrar.set_earlier(earlier);
        let [straight, turned] =
            [0.0, PI].map(|turn| registrar.search(wrap_angle(candidate.yaw_rad + turn), None));
        let half_turn = turned.score > straight.score;
        let (best, other) = match half_turn {
            true => (turned, straight),
            false => (straight, turned),
        };
        let second = best.runner_up.map_or(0.0, |second| second.score);
        let searched = pose(best.x_m, best.y_m, best.yaw_rad);
        let mut found = Verification {
            outcome: VerificationOutcome::LowCorrelation,
            motion: UncertainMotion {
                motion: searched,
                ..UncertainMotion::identity()
            },
            correlation: best.score,
            searched: best.score,
            runner_up: second.max(other.score),
            half_turn,
        };
        if best.score < MIN_CORRELATION - COARSE_LOSS {
            return found;
        }
        match registrar.aligner.align(later, earlier, false, &searched) {
            Some(motion) => {
                found.motion = motion;
                found.correlation = registrar.correlation(&motion.motion, None);
                found.outcome = judge(&found);
            }
            None => found.outcome = VerificationOutcome::Undetermined,
        }
        found
    }
}

fn judge(found: &Verification) -> VerificationOutcome {
    if found.correlation < MIN_CORRELATION {
        VerificationOutcome::LowCorrelation
    } else if found.searched - found.runner_up < MIN_MARGIN {
        VerificationOutcome::Ambiguous
    } else {
        VerificationOutcome::Accepted
    }
}
