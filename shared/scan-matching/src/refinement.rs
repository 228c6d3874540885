//! Joint refinement of (x, y, yaw) against a local map of the last keyframes.
//!
//! A scan is a list of sparse points. The map is the mean of what the last keyframes saw, each drawn once from its own
//! points at its own pose, blurred and saturated. The points are laid on the map by Levenberg-Marquardt, on a coarse map
//! first and then on the fine one, while the sweep's distortion is undone with the very motion that is sought.
//!
//! Nothing is believed blindly: a match that no vehicle could have driven, or that overlaps the map far less than usual,
//! is tried again from another start, and given up for the motion before if that does not help.

mod config;
mod keyframes;
mod level;
mod memory;
mod register;
mod sweep;

use gyre_geometry::{Pose, SparsePoint, Twist, UncertainMotion};
use nalgebra::{Matrix3, Vector3};

pub use config::{RefinementConfig, RefinementKind};
pub use keyframes::Keyframe;
pub use memory::{Anchor, TrackerState};

use crate::ConfigError;
use keyframes::Keyframes;
use register::{Match, register};
use sweep::Placed;

/// Most steps of a descent on the coarse map, and on the fine one.
const COARSE_STEPS: usize = 10;
const FINE_STEPS: usize = 6;
/// On the coarse map one point in so many will do.
const COARSE_POINTS: usize = 3;
/// How often the points are placed anew, by the motion just found, and matched on the fine map.
const FINE_ROUNDS: usize = 2;
/// Starts nearer to each other than this share a valley: coarse cells, and rad.
const SAME_VALLEY: (f64, f64) = (0.5, 0.035);
/// A start's coarse overlap must be better by this factor than the prediction's to be preferred to it.
const CLEARLY_BETTER: f64 = 1.02;
/// What has been doubted so many times in a row is how things are now.
const MOST_DOUBTFUL: u32 = 2;
/// By how much the covariance of a weak match is wider.
const WEAK_SPREAD: f64 = 4.0;
/// Turns of the prediction that are tried when nothing else fits, rad.
const FAN: [f64; 4] = [-0.1, 0.1, -0.2, 0.2];

/// How a motion came about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// Refined.
    Refined,
    /// Refined, but with little to go by; kept out of the map.
    Weak,
    /// Nothing fitted: the motion before goes on.
    Predicted,
}

/// What a match started from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InitialGuess {
    /// The motion before goes on.
    Prediction,
    /// The search's motion.
    Search,
    /// The prediction turned to one side, tried when nothing else fitted.
    YawOffset,
}

/// The refined motion: pose of the later scan's frame in the earlier one's.
#[derive(Debug, Clone, Copy)]
pub struct Refined {
    /// The motion, and its covariance of (x, y, yaw).
    pub motion: UncertainMotion,
    /// Mean of the map under the points, 0 to 1.
    pub overlap: f64,
    /// The points' weight, as a share of what is usual.
    pub support: f64,
    /// How it came about.
    pub outcome: Outcome,
    /// What the accepted match started from; the prediction where there is none.
    pub guess: InitialGuess,
}

/// Refines motions scan by scan; remembers the last keyframes.
#[derive(Debug)]
pub struct Refiner {
    config: RefinementConfig,
    keyframes: Keyframes,
    memory: TrackerState,
    placed: Placed,
}

/// A scan to be matched.
#[derive(Clone, Copy)]
struct Query<'a> {
    points: &'a [SparsePoint],
    /// Pose in the first scan's frame that the search's motion leads to.
    searched: Pose,
    interval_s: f64,
}

/// A match, what it started from, and what it is worth.
#[derive(Clone, Copy)]
struct Candidate {
    hypothesis: InitialGuess,
    found: Match,
    overlap: f64,
    support: f64,
    /// Whether it can be, and fits well enough, to be believed.
    believed: bool,
}

impl Refiner {
    /// Plans the refinement of scans of at most `capacity` points.
    ///
    /// # Errors
    /// The first key of `config` that no refinement can be built from.
    pub fn new(config: &RefinementConfig, capacity: usize) -> Result<Self, ConfigError> {
        config.validate()?;
        Ok(Self {
            keyframes: Keyframes::new(config),
            config: config.clone(),
            memory: TrackerState::default(),
            placed: Placed::with_capacity(capacity),
        })
    }

    /// Forgets all: a chain of motions starts with the next scan.
    pub fn reset(&mut self) {
        self.memory = TrackerState::default();
        self.keyframes.clear();
    }

    /// What the next call depends on besides the keyframes.
    pub fn state(&self) -> &TrackerState {
        &self.memory
    }

    /// The keyframes of the map, oldest first.
    pub fn keyframes(&self) -> impl Iterator<Item = &Keyframe> {
        self.keyframes.iter()
    }

    /// Cells of a keyframe's images together.
    pub fn keyframe_cells(&self) -> usize {
        self.keyframes.cells()
    }

    /// Goes on where another one stood: `load` fills the next keyframe, oldest first, and says whether there was one.
    pub fn restore(&mut self, memory: TrackerState, mut load: impl FnMut(&mut Keyframe) -> bool) {
        self.keyframes.clear();
        while self.keyframes.push(&mut load) {}
        self.keyframes.stack();
        self.memory = memory;
    }

    /// The motion from the `earlier` scan's points to the `later` one's, which are those of scan number `id`, starting from
    /// what the search found. The earlier points are looked at where there is no map yet.
    pub fn refine(
        &mut self,
        id: u64,
        later: &[SparsePoint],
        earlier: &[SparsePoint],
        searched: &Pose,
        interval_s: f64,
    ) -> Refined {
        // Stamps that stand still say nothing about velocities: as if a second had passed.
        let interval_s = if interval_s > 0.0 { interval_s } else { 1.0 };
        let query = Query {
            points: later,
            searched: self.memory.pose * searched,
            interval_s,
        };
        if self.keyframes.is_empty() {
            self.begin(id.wrapping_sub(1), earlier, &query);
        }
        let mut best = self.best_of(&query, &self.starts(&query));
        if !best.believed {
            let [prediction, _] = self.memory.foretell(interval_s);
            let fan = FAN.map(|turn| (InitialGuess::YawOffset, prediction * Pose::rotation(turn)));
            let other = self.best_of(&query, &fan);
            if other.believed {
                best = other;
            }
        }
        self.conclude(id, &query, &best)
    }

    /// Makes the earlier scan the first keyframe. Its sweep is undone with the motion to the later one: first the search's, then
    /// the one that this leads to.
    fn begin(&mut self, id: u64, earlier: &[SparsePoint], query: &Query<'_>) {
        let pose = self.memory.pose;
        let searched = self.memory.velocity_to(&query.searched, query.interval_s);
        self.draw(id, earlier, &pose, &searched);
        let found = self.best_of(query, &self.starts(query)).found.pose;
        let found = self.memory.velocity_to(&found, query.interval_s);
        self.keyframes.clear();
        self.draw(id, earlier, &pose, &found);
    }

    /// Where to start from; the same place again counts once.
    fn starts(&self, query: &Query<'_>) -> [(InitialGuess, Pose); 3] {
        let [prediction, before] = self.memory.foretell(query.interval_s);
        [
            (InitialGuess::Prediction, prediction),
            (InitialGuess::Search, query.searched),
            (InitialGuess::Prediction, before),
        ]
    }

    /// Descends from each start on the coarse map, and from the best of them on the fine one.
    fn best_of(&mut self, query: &Query<'_>, starts: &[(InitialGuess, Pose)]) -> Candidate {
        let coarse = self.keyframes.coarse();
        let mut best: Option<(InitialGuess, Match, bool)> = None;
        for (k, (hypothesis, start)) in starts.iter().enumerate() {
            if starts[..k]
                .iter()
                .any(|(_, other)| self.in_one_valley(start, other))
            {
                continue;
            }
            // By the start's own motion: in a sweep of a second, that of the scan before is ten degrees off where a turn begins.
            self.placed.place(
                query.points,
                &self.memory.velocity_to(start, query.interval_s),
            );
            self.placed.thin(COARSE_POINTS);
            let found = register(&coarse, &self.placed, start, COARSE_STEPS);
            let allowed = self
                .memory
                .allows(&found.pose, query.interval_s, 1.0, &self.config);
            let better = best.is_none_or(|(_, best, best_allowed)| match (allowed, best_allowed) {
                (true, true) | (false, false) => {
                    found.normal.overlap > CLEARLY_BETTER * best.normal.overlap
                }
                (allowed, _) => allowed,
            });
            if better {
                best = Some((*hypothesis, found, allowed));
            }
        }
        let (hypothesis, pose) = best
            .map_or((InitialGuess::Prediction, self.memory.pose), |(h, m, _)| {
                (h, m.pose)
            });
        let found = self.fine(query, pose);
        self.judge(query, hypothesis, found)
    }

    fn in_one_valley(&self, a: &Pose, b: &Pose) -> bool {
        let apart = a.inv_mul(b);
        let cell_m = self.config.cell_m * self.config.coarse;
        apart.translation.vector.norm() <= SAME_VALLEY.0 * cell_m
            && apart.rotation.angle().abs() <= SAME_VALLEY.1
    }

    /// Matches on the fine map, the sweep undone by the motion found so far.
    fn fine(&mut self, query: &Query<'_>, mut pose: Pose) -> Match {
        let fine = self.keyframes.fine();
        let mut round = |pose: &Pose| {
            self.placed.place(
                query.points,
                &self.memory.velocity_to(pose, query.interval_s),
            );
            register(&fine, &self.placed, pose, FINE_STEPS)
        };
        for _ in 1..FINE_ROUNDS {
            pose = round(&pose).pose;
        }
        round(&pose)
    }

    fn judge(&self, query: &Query<'_>, hypothesis: InitialGuess, found: Match) -> Candidate {
        let weight = self.placed.total_weight();
        let overlap = if weight > 0.0 {
            found.normal.overlap / weight
        } else {
            0.0
        };
        let support = if self.memory.mean_weight > 0.0 {
            weight / self.memory.mean_weight
        } else {
            1.0
        };
        let fits = overlap > 0.0 && overlap >= self.config.min_overlap * self.memory.mean_overlap;
        let allowed = self.memory.allows(
            &found.pose,
            query.interval_s,
            support.min(1.0),
            &self.config,
        );
        Candidate {
            hypothesis,
            found,
            overlap,
            support,
            believed: fits && allowed,
        }
    }

    /// Takes the candidate, or the prediction where it is not believed, and remembers.
    fn conclude(&mut self, id: u64, query: &Query<'_>, candidate: &Candidate) -> Refined {
        let Candidate {
            hypothesis,
            found,
            overlap,
            support,
            believed,
        } = *candidate;
        let weight = self.placed.total_weight();
        let before = self.memory.pose;
        let (outcome, pose, covariance) = match self.covariance(&found, weight) {
            Some(covariance) if believed => match self.outcome(query, candidate) {
                Outcome::Weak => (Outcome::Weak, found.pose, covariance * WEAK_SPREAD),
                firm => (firm, found.pose, covariance),
            },
            _ => {
                let [prediction, _] = self.memory.foretell(query.interval_s);
                (
                    Outcome::Predicted,
                    prediction,
                    memory::unmatched_covariance(query.interval_s, &self.config),
                )
            }
        };
        let hypothesis = if outcome == Outcome::Predicted {
            InitialGuess::Prediction
        } else {
            hypothesis
        };
        let velocity = self.memory.velocity_to(&pose, query.interval_s);
        self.memory.go_on(
            pose,
            outcome,
            [overlap, weight],
            query.interval_s,
            &self.config,
        );
        if self.memory.unmatched >= self.config.max_unmatched {
            // The next scan is compared with this one alone, and the one after that with the next, until two are alike.
            self.keyframes.clear();
        } else if outcome == Outcome::Refined && self.keyframes.is_far(&pose, &self.config) {
            self.draw(id, query.points, &pose, &velocity);
        }
        Refined {
            motion: UncertainMotion {
                motion: before.inv_mul(&pose),
                covariance,
            },
            overlap,
            support,
            outcome,
            guess: hypothesis,
        }
    }

    /// Whether a match that is believed may be built upon.
    fn outcome(&self, query: &Query<'_>, candidate: &Candidate) -> Outcome {
        let config = &self.config;
        let apart = query.searched.inv_mul(&candidate.found.pose);
        let agrees = apart.translation.vector.norm() <= config.search_agrees_m
            && apart.rotation.angle().abs() <= config.search_agrees_deg.to_radians();
        let fits = candidate.overlap >= config.firm_overlap * self.memory.mean_overlap;
        let firm = fits && agrees && candidate.support >= config.min_support;
        let firm = firm || self.memory.doubtful >= MOST_DOUBTFUL;
        if firm {
            Outcome::Refined
        } else {
            Outcome::Weak
        }
    }

    /// Of the motion, from the information matrix at the match; `None` where the points do not fix it.
    fn covariance(&self, found: &Match, weight: f64) -> Option<Matrix3<f64>> {
        let inverse = found.normal.information.try_inverse()?;
        let mean_squared_residual = found.normal.cost / weight;
        // From the world's axes into those of the frame before.
        let turn = self
            .memory
            .pose
            .rotation
            .inverse()
            .to_rotation_matrix()
            .to_homogeneous();
        // If each point weighed half as much, as under a mask, the information would be half of what it was, and the match the same.
        let scale = self.config.variance_scale * self.placed.mean_weight() * mean_squared_residual;
        let shape = turn * inverse * turn.transpose() * scale;
        let yaw = self.config.yaw_sigma_deg.to_radians().powi(2);
        let covariance = shape + Matrix3::from_diagonal(&Vector3::new(0.0, 0.0, yaw));
        covariance
            .iter()
            .all(|v| v.is_finite())
            .then_some(covariance)
    }

    fn draw(&mut self, id: u64, points: &[SparsePoint], pose: &Pose, velocity: &Twist) {
        self.placed.place(points, velocity);
        self.keyframes.draw(id, &self.placed, pose);
    }
}
