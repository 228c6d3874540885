//! Verification of loops by registration.

use std::f64::consts::PI;

use gyre_geometry::{Pose, UncertainMotion, pose, wrap_angle};
use gyre_scan_matching::{
    ConfigError, KeyframeAligner, MaskedCorrelation, MotionMatch, RefinementConfig, RotationMatch,
    Submap, TranslationConfig, TranslationSearch,
};
use ndarray::Array2;

use super::{CELL_M, Candidate, PLANNED, RASTER_CELLS};

/// Cells within this range of both sensors are correlated: farther away few points are extracted.
const MASK_M: f64 = 80.0;
/// Largest translation between two places that are verified, along each axis, m.
const REACH_M: f64 = 25.0;
/// Smallest correlation of a loop that is accepted.
const MIN_CORRELATION: f64 = 0.65;
/// Smallest difference of the correlations of an accepted loop and of any other motion between the
/// two places.
const MIN_MARGIN: f64 = 0.1;
/// A match on whole cells at an angle of the descriptors' grid is this much below the final one at
/// most.
const COARSE_LOSS: f64 = 0.15;

/// The verdict on a candidate, and the reason of a rejection.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VerificationOutcome {
    /// The two submaps show the same place.
    Accepted,
    /// The correlation is below 0.65.
    LowCorrelation,
    /// Another motion correlates nearly as well: less than 0.1 below.
    Ambiguous,
    /// The points of the two keyframes do not determine the motion.
    Undetermined,
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
    /// See [`Self::searched`].
    pub runner_up: f64,
    /// The yaw differs from the candidate's by half a turn.
    pub half_turn: bool,
}

/// Registers the submap of a query with the submaps of candidates.
///
/// Planned once; nothing is allocated afterwards.
pub struct LoopVerifier {
    translation: TranslationSearch,
    aligner: KeyframeAligner,
    correlation: MaskedCorrelation,
    later: Array2<f32>,
    earlier: Array2<f32>,
}

impl LoopVerifier {
    /// Plans registrations of keyframes of at most `capacity` points. `refinement` is the
    /// refinement of the odometry: its cells and reach, and the scales of its covariance.
    ///
    /// # Errors
    /// The first value of `refinement` that is out of its bounds.
    pub fn new(refinement: &RefinementConfig, capacity: usize) -> Result<Self, ConfigError> {
        let translation = TranslationConfig {
            reach_m: REACH_M,
            ..TranslationConfig::default()
        };
        let raster = || Array2::zeros((RASTER_CELLS, RASTER_CELLS));
        Ok(Self {
            translation: TranslationSearch::new(RASTER_CELLS, CELL_M, &translation)?,
            aligner: KeyframeAligner::new(refinement, capacity)?,
            correlation: MaskedCorrelation::new(RASTER_CELLS, CELL_M, MASK_M)?,
            later: raster(),
            earlier: raster(),
        })
    }

    /// Registers the submap of the query, `later`, with the submap of the candidate, `earlier`.
    pub fn verify(
        &mut self,
        later: &Submap,
        earlier: &Submap,
        candidate: &Candidate,
    ) -> Verification {
        draw(later, &mut self.later);
        draw(earlier, &mut self.earlier);
        let [straight, turned] =
            [0.0, PI].map(|turn| self.search(wrap_angle(candidate.yaw_rad + turn)));
        let half_turn = turned.score > straight.score;
        let (best, other) = if half_turn {
            (turned, straight)
        } else {
            (straight, turned)
        };
        let second = best.runner_up.map_or(0.0, |second| second.score);
        let searched = pose(best.x_m, best.y_m, best.yaw_rad);
        let mut found = Verification {
            outcome: VerificationOutcome::LowCorrelation,
            motion: certain(searched),
            correlation: best.score,
            searched: best.score,
            runner_up: second.max(other.score),
            half_turn,
        };
        if best.score < MIN_CORRELATION - COARSE_LOSS {
            return found;
        }
        match self.aligner.align(later, earlier, &searched) {
            Some(motion) => {
                found.motion = motion;
                found.correlation = self.correlation_at(&motion.motion);
                found.outcome = self.judge(&found);
            }
            None => found.outcome = VerificationOutcome::Undetermined,
        }
        found
    }

    /// The translation if the angle is `angle_rad`.
    fn search(&mut self, angle_rad: f64) -> MotionMatch {
        let rotation = RotationMatch {
            angle_rad,
            variance_rad2: 0.0,
            score: 1.0,
            runner_up: None,
        };
        self.translation
            .search(self.later.view(), self.earlier.view(), &rotation)
            .expect(PLANNED)
    }

    fn correlation_at(&mut self, motion: &Pose) -> f64 {
        self.correlation
            .at(self.later.view(), self.earlier.view(), None, motion)
            .expect(PLANNED)
    }

    fn judge(&self, found: &Verification) -> VerificationOutcome {
        if found.correlation < MIN_CORRELATION {
            VerificationOutcome::LowCorrelation
        } else if found.searched - found.runner_up < MIN_MARGIN {
            VerificationOutcome::Ambiguous
        } else {
            VerificationOutcome::Accepted
        }
    }
}

/// Draws the root of a submap's weights: a few strong scatterers would outweigh all others.
fn draw(submap: &Submap, raster: &mut Array2<f32>) {
    submap.draw(CELL_M, raster.view_mut()).expect(PLANNED);
    raster.mapv_inplace(f32::sqrt);
}

fn certain(motion: Pose) -> UncertainMotion {
    UncertainMotion {
        motion,
        ..UncertainMotion::identity()
    }
}
