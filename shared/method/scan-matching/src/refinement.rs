//! Refinement of (x, y, yaw) by aligning sparse points with a local map of the last keyframes.
//!
//! The map is the mean of what the last keyframes saw, each drawn once from its own points at its own pose, blurred and
//! saturated. A scan is aligned with it by Gauss-Newton steps, first on a coarse map and then on the fine one, and is
//! deskewed with the very motion that is sought.
//!
//! Reading order:
//! - [`Refiner::refine`]: the method;
//! - `points`: a scan's points, deskewed;
//! - `local_map`, `map_level`: the keyframes, and the two rasters that points are aligned with;
//! - `alignment`, `normal_equations`: Gauss-Newton with a line search;
//! - `tracker`: the last poses, what is predicted from them, and which poses a vehicle can have reached;
//! - `uncertainty`: covariances;
//! - `standstill`: the pose of a standing vehicle is held;
//! - [`KeyframeAligner`]: the same alignment for two keyframes of one place that are far apart in time.

mod alignment;
mod config;
mod initial_guess;
mod keyframe_aligner;
mod local_map;
mod map_level;
mod normal_equations;
mod points;
mod standstill;
mod tracker;
mod uncertainty;

pub use config::{RefinementConfig, RefinementKind};
use gyre_geometry::{OdometryMotion, Pose, SparsePoint, Twist, UncertainMotion};
pub use initial_guess::InitialGuess;
pub use keyframe_aligner::KeyframeAligner;
pub use local_map::Keyframe;
pub use standstill::Standstill;
pub use tracker::{Anchor, TrackerState};

use crate::ConfigError;
use alignment::{Alignment, align};
use initial_guess::{initial_guesses, yaw_offsets};
use local_map::LocalMap;
pub(crate) use points::DeskewedPoints;
use standstill::Estimate;

const COARSE_ITERATIONS: usize = 10;
const FINE_ITERATIONS: usize = 6;
/// On the coarse map every third point is enough.
const COARSE_STRIDE: usize = 3;
/// Times that the points are deskewed by the newest motion and aligned on the fine map.
const FINE_ROUNDS: usize = 2;
/// Initial guesses closer to each other than this lie in one basin of attraction.
const SAME_BASIN_COARSE_CELLS: f64 = 0.5;
const SAME_BASIN_RAD: f64 = 0.035;
/// A later guess is preferred to an earlier one if its coarse overlap is better by this factor.
const CLEARLY_BETTER: f64 = 1.02;
/// After this many doubtful scans in a row a plausible match is accepted.
const MAX_DOUBTFUL: u32 = 2;
/// Factor on the covariance of a weak match.
const WEAK_COVARIANCE_FACTOR: f64 = 4.0;
/// The reliability of a refined motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// Aligned with the map.
    Refined,
    /// Aligned, but doubtful; kept out of the map.
    Weak,
    /// No plausible match: the motion is predicted at constant velocity.
    Predicted,
}

/// A refined motion.
#[derive(Debug, Clone, Copy)]
pub struct Refined {
    /// Pose of the later scan's frame in the earlier one's, with its covariance.
    pub motion: OdometryMotion,
    /// Mean of the map under the points, 0 to 1.
    pub overlap: f64,
    /// Weight of the points as a share of its running mean; 1 if there is none yet.
    pub support: f64,
    /// The reliability of the motion.
    pub outcome: Outcome,
    /// The initial guess of the accepted match; the prediction if there is none.
    pub guess: InitialGuess,
    /// The vehicle stands: the motion is zero.
    pub stationary: bool,
}

/// Refines motions scan by scan against a map of the last keyframes.
///
/// Nothing is allocated after construction.
#[derive(Debug)]
pub struct Refiner {
    config: RefinementConfig,
    map: LocalMap,
    state: TrackerState,
    points: DeskewedPoints,
}

/// A scan to be aligned.
struct Scan<'a> {
    id: u64,
    points: &'a [SparsePoint],
    /// Pose in the map by the motion that the search found.
    searched: Pose,
    /// Time since the scan before, s.
    interval_s: f64,
}

/// An alignment on the coarse map.
struct CoarseMatch {
    guess: InitialGuess,
    coarse: Alignment,
    is_reachable: bool,
}

/// An alignment on the fine map and how well it fits.
struct Candidate {
    guess: InitialGuess,
    alignment: Alignment,
    overlap: f64,
    /// Sum of the points' weights, and the same as a share of its running mean.
    weight: f64,
    support: f64,
    /// A vehicle can have driven there, and the scan overlaps the map about as much as the scans before.
    is_plausible: bool,
}

impl CoarseMatch {
    /// Returns whether a vehicle can have driven there but not to the other, or else the overlap is clearly larger.
    fn is_better_than(&self, other: &Self) -> bool {
        if self.is_reachable == other.is_reachable {
            self.coarse.normal.overlap > CLEARLY_BETTER * other.coarse.normal.overlap
        } else {
            self.is_reachable
        }
    }
}

impl Refiner {
    /// Plans the refinement of scans of at most `capacity` points.
    ///
    /// # Errors
    /// The first key of `config` that is out of its bounds.
    pub fn new(config: &RefinementConfig, capacity: usize) -> Result<Self, ConfigError> {
        config.validate()?;
        Ok(Self {
            map: LocalMap::new(config),
            config: config.clone(),
            state: TrackerState::default(),
            points: DeskewedPoints::with_capacity(capacity),
        })
    }

    /// Refines the motion from the `earlier` scan to the `later` one, which has number `scan`.
    ///
    /// `searched` is the motion that the search found, `interval_s` the time between the stamps. The earlier points are
    /// used only while the map is empty.
    pub fn refine(
        &mut self,
        scan: u64,
        later: &[SparsePoint],
        earlier: &[SparsePoint],
        searched: &Pose,
        interval_s: f64,
    ) -> Refined {
        let scan = Scan {
            id: scan,
            points: later,
            searched: self.state.pose * searched,
            // Stamps that do not advance give no velocity: a second is assumed.
            interval_s: if interval_s > 0.0 { interval_s } else { 1.0 },
        };
        // Predictions in a row whose error a match takes back. A new map starts at the pose that they led to, with their error.
        let predictions = if self.map.is_empty() {
            self.start_map(&scan, earlier);
            0
        } else {
            self.state.unmatched
        };
        let predicted = self.state.predict(scan.interval_s);
        let mut best = self.align(&scan, &initial_guesses(predicted, scan.searched));
        if !best.is_plausible {
            let offset = self.align(&scan, &yaw_offsets(predicted[0]));
            if offset.is_plausible {
                best = offset;
            }
        }
        let (outcome, estimate) = self.accept_or_predict(&scan, &best);
        let mut reported = self.report(&scan, outcome, estimate);
        let stationary = self.config.hold_standstill && self.state.standstill.stands();
        if !stationary {
            let of_one = uncertainty::of_prediction(scan.interval_s, &self.config);
            reported.covariance += of_one * f64::from(predictions);
        }
        let keyframes = self.map.len();
        self.update(&scan, &best, outcome, &estimate.motion);
        let drift_share = if self.map.is_empty() {
            1.0
        } else if outcome == Outcome::Predicted || predictions > 0 {
            uncertainty::MIN_DRIFT_SHARE
        } else {
            uncertainty::drift_share(keyframes, &self.config)
        };
        Refined {
            motion: OdometryMotion {
                motion: reported.motion,
                covariance: reported.covariance,
                drift_share,
                scale_sigma: self.config.scale_sigma,
            },
            stationary,
            overlap: best.overlap,
            support: best.support,
            guess: match outcome {
                Outcome::Predicted => InitialGuess::Prediction,
                Outcome::Refined | Outcome::Weak => best.guess,
            },
            outcome,
        }
    }

    /// Forgets the map and the tracker state: the next scan starts a new chain of motions.
    pub fn reset(&mut self) {
        self.state = TrackerState::default();
        self.map.clear();
    }

    /// Restores an earlier state. `load` fills in the next keyframe, oldest first, and returns whether there was one.
    pub fn restore(&mut self, state: TrackerState, load: impl FnMut(&mut Keyframe) -> bool) {
        self.map.restore(load);
        self.state = state;
    }

    /// Returns the state that the next motion depends on, apart from the keyframes.
    pub fn state(&self) -> &TrackerState {
        &self.state
    }

    /// Returns the keyframes of the map, oldest first.
    pub fn keyframes(&self) -> impl Iterator<Item = &Keyframe> {
        self.map.keyframes()
    }

    /// Returns the number of cells of both images of a keyframe.
    pub fn keyframe_cells(&self) -> usize {
        self.map.keyframe_cells()
    }

    /// Makes the earlier scan the first keyframe, deskewed with the motion to the later scan: first with the searched
    /// motion, then with the one that aligning the later scan gives.
    fn start_map(&mut self, scan: &Scan<'_>, earlier: &[SparsePoint]) {
        let (id, pose) = (scan.id.wrapping_sub(1), self.state.pose);
        let twist = self.state.twist_to(&scan.searched, scan.interval_s);
        self.insert_keyframe(id, earlier, &pose, &twist);
        let guesses = initial_guesses(self.state.predict(scan.interval_s), scan.searched);
        let aligned = self.align(scan, &guesses).alignment.pose;
        let twist = self.state.twist_to(&aligned, scan.interval_s);
        self.map.clear();
        self.insert_keyframe(id, earlier, &pose, &twist);
    }

    /// Aligns the scan from each initial guess on the coarse map, and from the best of them on the fine map.
    fn align(&mut self, scan: &Scan<'_>, guesses: &[(InitialGuess, Pose)]) -> Candidate {
        let (guess, coarse) = self.align_coarse(scan, guesses);
        let alignment = self.align_fine(scan, coarse);
        self.assess(scan, guess, alignment)
    }

    fn align_coarse(
        &mut self,
        scan: &Scan<'_>,
        guesses: &[(InitialGuess, Pose)],
    ) -> (InitialGuess, Pose) {
        let mut best: Option<CoarseMatch> = None;
        for (k, (guess, initial)) in guesses.iter().enumerate() {
            if guesses[..k]
                .iter()
                .any(|(_, other)| self.in_same_basin(initial, other))
            {
                continue;
            }
            // Each guess deskews with its own motion. With a sweep of a second, the motion of the scan before is ten
            // degrees off where a bend begins.
            self.deskew(scan, initial);
            self.points.thin(COARSE_STRIDE);
            let coarse = align(&self.map.coarse(), &self.points, initial, COARSE_ITERATIONS);
            let found = CoarseMatch {
                guess: *guess,
                is_reachable: self.is_reachable(scan, &coarse.pose, 1.0),
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
        let cell_m = self.config.cell_m * self.config.coarse;
        apart.translation.vector.norm() <= SAME_BASIN_COARSE_CELLS * cell_m
            && apart.rotation.angle().abs() <= SAME_BASIN_RAD
    }

    fn align_fine(&mut self, scan: &Scan<'_>, coarse: Pose) -> Alignment {
        let mut pose = coarse;
        for _ in 1..FINE_ROUNDS {
            pose = self.align_fine_once(scan, &pose).pose;
        }
        self.align_fine_once(scan, &pose)
    }

    fn align_fine_once(&mut self, scan: &Scan<'_>, pose: &Pose) -> Alignment {
        self.deskew(scan, pose);
        align(&self.map.fine(), &self.points, pose, FINE_ITERATIONS)
    }

    /// Deskews the scan with the motion that leads to `pose`.
    fn deskew(&mut self, scan: &Scan<'_>, pose: &Pose) {
        let twist = self.state.twist_to(pose, scan.interval_s);
        self.points.deskew(scan.points, &twist);
    }

    fn assess(&self, scan: &Scan<'_>, guess: InitialGuess, alignment: Alignment) -> Candidate {
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
            is_plausible: fits && self.is_reachable(scan, &alignment.pose, support.min(1.0)),
            guess,
            alignment,
            overlap,
            weight,
            support,
        }
    }

    fn is_reachable(&self, scan: &Scan<'_>, pose: &Pose, jitter_share: f64) -> bool {
        self.state
            .can_reach(pose, scan.interval_s, jitter_share, &self.config)
    }

    /// Returns the pose of a plausible match and the covariance of its motion, or the predicted ones.
    fn accept_or_predict(&self, scan: &Scan<'_>, best: &Candidate) -> (Outcome, UncertainMotion) {
        let pose = &self.state.pose;
        let covariance =
            uncertainty::of_alignment(&best.alignment, &self.points, pose, &self.config);
        let Some(covariance) = covariance.filter(|_| best.is_plausible) else {
            let [motion, _] = self.state.predict(scan.interval_s);
            let covariance = uncertainty::of_prediction(scan.interval_s, &self.config);
            return (Outcome::Predicted, UncertainMotion { motion, covariance });
        };
        let motion = best.alignment.pose;
        if self.is_firm(scan, best) || self.state.doubtful >= MAX_DOUBTFUL {
            (Outcome::Refined, UncertainMotion { motion, covariance })
        } else {
            let covariance = covariance * WEAK_COVARIANCE_FACTOR;
            (Outcome::Weak, UncertainMotion { motion, covariance })
        }
    }

    /// Returns whether the scan overlaps the map well, has enough points, and agrees with the search.
    fn is_firm(&self, scan: &Scan<'_>, best: &Candidate) -> bool {
        let config = &self.config;
        let apart = scan.searched.inv_mul(&best.alignment.pose);
        best.overlap >= config.firm_overlap * self.state.mean_overlap
            && best.support >= config.min_support
            && apart.translation.vector.norm() <= config.search_agrees_m
            && apart.rotation.angle().abs() <= config.search_agrees_deg.to_radians()
    }

    /// Returns the motion to the estimated pose; none while the vehicle stands.
    fn report(
        &mut self,
        scan: &Scan<'_>,
        outcome: Outcome,
        estimate: UncertainMotion,
    ) -> UncertainMotion {
        let previous = self.state.pose;
        if !self.config.hold_standstill {
            let motion = previous.inv_mul(&estimate.motion);
            return UncertainMotion { motion, ..estimate };
        }
        self.state.standstill.next(&Estimate {
            pose: estimate,
            previous,
            outcome,
            interval_s: scan.interval_s,
        })
    }

    /// Updates the tracker state and the map with the accepted or predicted pose.
    fn update(&mut self, scan: &Scan<'_>, best: &Candidate, outcome: Outcome, pose: &Pose) {
        let (config, fit) = (&self.config, [best.overlap, best.weight]);
        let twist = self.state.twist_to(pose, scan.interval_s);
        self.state
            .update(*pose, outcome, fit, scan.interval_s, config);
        if self.state.unmatched >= config.max_unmatched {
            // A new map starts with this scan at the next call, and so on until two scans match.
            self.map.clear();
        } else if outcome == Outcome::Refined && self.map.needs_keyframe(pose, config) {
            self.insert_keyframe(scan.id, scan.points, pose, &twist);
        }
    }

    fn insert_keyframe(&mut self, id: u64, points: &[SparsePoint], pose: &Pose, twist: &Twist) {
        self.points.deskew(points, twist);
        self.map.insert(id, &self.points, pose);
    }
}
