//! The best match of a scan: aligned with the coarse map from several initial guesses, and from the
//! best of them with the fine map.

use gyre_geometry::{Pose, SparsePoint, Twist};
use nalgebra::UnitVector2;

use super::{
    RefinementConfig, TrackerState, alignment::Alignment, config::COARSE, local_map::LocalMap,
    points::DeskewedPoints, registration::Registration, tracker::Step,
};

/// Initial guesses closer to each other than this lie in one basin of attraction.
const SAME_BASIN_COARSE_CELLS: f64 = 0.5;
const SAME_BASIN_RAD: f64 = 0.035;
/// A later guess is preferred to an earlier one if its coarse overlap is better by this factor.
const CLEARLY_BETTER: f64 = 1.02;

/// Yaw offsets from the prediction, tried if no other initial guess gives a plausible match.
const YAW_OFFSETS_RAD: [f64; 4] = [-0.1, 0.1, -0.2, 0.2];

/// The initial guess that an alignment started from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InitialGuess {
    Prediction,
    /// The motion that the search found; along walls also the mean of that and the prediction.
    Search,
    /// The prediction with a yaw offset, tried if nothing else gave a plausible match.
    YawOffset,
    /// The prediction, whose place along walls without structure stays: the radar does not see how
    /// far the vehicle has driven. The wheels or the motions before determine it.
    AlongWalls,
}

pub(super) struct Scan<'a> {
    pub id: u64,
    pub points: &'a [SparsePoint],
    pub searched: Pose,
    pub step: Step,
    /// Variance of the turn by the mean azimuths of this scan and the one before, rad².
    pub azimuth_variance_rad2: f64,
}

pub(super) struct Candidates<'a> {
    pub scan: &'a Scan<'a>,
    pub map: &'a LocalMap,
    pub state: &'a TrackerState,
    pub config: &'a RefinementConfig,
    /// Memory for the deskewed points: afterwards the points of the last alignment.
    pub points: &'a mut DeskewedPoints,
}

pub(super) struct Candidate {
    pub guess: InitialGuess,
    pub alignment: Alignment,
    pub overlap: f64,
    /// Sum of the points' weights, and the same as a share of its running mean.
    pub weight: f64,
    pub support: f64,
    pub fits: bool,
    /// So it does, and a vehicle can have driven there.
    pub is_plausible: bool,
}

struct CoarseMatch {
    guess: InitialGuess,
    coarse: Alignment,
    is_reachable: bool,
}

impl CoarseMatch {
    /// Returns whether a vehicle can have driven there but not to the other, or else the overlap is
    /// clearly larger.
    fn is_better_than(&self, other: &Self) -> bool {
        if self.is_reachable == other.is_reachable {
            self.coarse.normal.overlap > CLEARLY_BETTER * other.coarse.normal.overlap
        } else {
            self.is_reachable
        }
    }
}

impl Candidates<'_> {
    /// Returns the best match of all initial guesses. Yaw offsets are tried where no other guess
    /// gives a plausible match.
    pub fn best(&mut self) -> Candidate {
        let best = self.match_prediction_or_search();
        if best.is_plausible {
            return best;
        }
        let [predicted, _] = self.state.predict(&self.scan.step);
        let offsets = YAW_OFFSETS_RAD.map(|offset| predicted * Pose::rotation(offset));
        let offset = self.align(&offsets.map(|pose| (InitialGuess::YawOffset, pose)));
        if offset.is_plausible { offset } else { best }
    }

    pub fn match_prediction_or_search(&mut self) -> Candidate {
        let [from_last, from_second_last] = self.state.predict(&self.scan.step);
        self.align(&[
            (InitialGuess::Prediction, from_last),
            (InitialGuess::Search, self.scan.searched),
            // In case the last match was wrong.
            (InitialGuess::Prediction, from_second_last),
        ])
    }

    /// Aligns the scan from each initial guess on the coarse map, and from the best of them on the
    /// fine map.
    fn align(&mut self, guesses: &[(InitialGuess, Pose)]) -> Candidate {
        let (guess, coarse) = self.best_coarse(guesses);
        let alignment = self.registration().align_fine(coarse, None);
        self.assess(guess, alignment)
    }

    fn best_coarse(&mut self, guesses: &[(InitialGuess, Pose)]) -> (InitialGuess, Pose) {
        let mut best: Option<CoarseMatch> = None;
        for (k, (guess, initial)) in guesses.iter().enumerate() {
            if guesses[..k]
                .iter()
                .any(|(_, other)| self.in_same_basin(initial, other))
            {
                continue;
            }
            // Each guess deskews with its own motion. With a sweep of a second, the motion of the
            // scan before is ten degrees off where a bend begins.
            let coarse = self.registration().align_coarse(initial, None);
            let found = CoarseMatch {
                guess: *guess,
                is_reachable: self.is_reachable(&coarse.pose, 1.0),
                coarse,
            };
            if best.as_ref().is_none_or(|best| found.is_better_than(best)) {
                best = Some(found);
            }
        }
        best.map_or((InitialGuess::Prediction, self.state.pose), |best| {
            (best.guess, best.coarse.pose)
        })
    }

    fn in_same_basin(&self, a: &Pose, b: &Pose) -> bool {
        let apart = a.inv_mul(b);
        let cell_m = self.config.cell_m * COARSE;
        apart.translation.vector.norm() <= SAME_BASIN_COARSE_CELLS * cell_m
            && apart.rotation.angle().abs() <= SAME_BASIN_RAD
    }

    pub fn registration(&mut self) -> Registration<'_, impl Fn(&Pose) -> Twist> {
        let (state, step) = (self.state, &self.scan.step);
        Registration {
            map: self.map,
            scan: self.scan.points,
            twist_to: |pose: &Pose| state.twist_to(pose, step),
            points: self.points,
        }
    }

    pub fn align_across(
        &mut self,
        guess: InitialGuess,
        initial: &Pose,
        locked: UnitVector2<f64>,
    ) -> Candidate {
        let coarse = self.registration().align_coarse(initial, Some(locked)).pose;
        let alignment = self.registration().align_fine(coarse, Some(locked));
        self.assess(guess, alignment)
    }

    fn assess(&self, guess: InitialGuess, alignment: Alignment) -> Candidate {
        let weight = self.points.total_weight();
        let overlap = if weight > 0.0 {
            alignment.normal.overlap / weight
        } else {
            0.0
        };
        let support = if self.state.mean_weight > 0.0 {
            weight / self.state.mean_weight
        } else {
            1.0
        };
        let fits = overlap > 0.0 && overlap >= self.config.min_overlap * self.state.mean_overlap;
        Candidate {
            is_plausible: fits && self.is_reachable(&alignment.pose, support),
            fits,
            guess,
            alignment,
            overlap,
            weight,
            support,
        }
    }

    /// Returns whether a vehicle can have driven to a pose, where the weight of the points is this
    /// share of its mean.
    fn is_reachable(&self, pose: &Pose, support: f64) -> bool {
        self.state
            .can_reach(pose, &self.scan.step, support.min(1.0), self.config)
    }
}
