//! The poses of keyframes, estimated from odometry and loops.

use gyre_estimation::{
    Constraint, EstimationError, FilterOptions, GraphOptions, Kind, Outcome, PoseGraph,
    TrajectoryFilter, Verdict,
};
use gyre_geometry::{Pose, UncertainMotion};

use crate::consistency::{DeadReckoning, consistent};
use crate::{Correction, Keyframe, Query};

/// The estimator of the poses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EstimatorKind {
    /// The pose graph: all poses by least squares.
    #[default]
    Graph,
    /// The extended Kalman filter over all poses, for short drives.
    Filter,
}

/// Options of [`TrajectoryEstimator`].
#[derive(Clone, Debug, PartialEq)]
pub struct TrajectoryOptions {
    /// The estimator.
    pub kind: EstimatorKind,
    /// Loops between two stretches of the path of this length count as one: their errors are dependent, m.
    pub group_m: f64,
}

impl Default for TrajectoryOptions {
    fn default() -> Self {
        Self {
            kind: EstimatorKind::Graph,
            group_m: 5.0,
        }
    }
}

/// The verdict of the trajectory on a loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LoopVerdict {
    /// The loop is part of the estimate.
    Used,
    /// It contradicts the odometry between its keyframes; in the filter, the estimate.
    ContradictsOdometry,
    /// It contradicts most of the other loops.
    ContradictsLoops,
    /// Its group has been counted in full (filter alone).
    Redundant,
}

/// A loop that was accepted by the [`LoopCloser`](crate::LoopCloser), and what became of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JudgedLoop {
    /// The loop, from the earlier to the later keyframe, in its group.
    pub constraint: Constraint,
    /// The verdict.
    pub verdict: LoopVerdict,
    /// The kernel's weight in the graph, 0 to 1; 0 if the loop is not used.
    pub weight: f64,
}

/// Estimates the poses of all keyframes from their motions and loops.
///
/// The result is a function of the keyframes and of the set of loops, and not of when loops came: [`TrajectoryEstimator::solve`] begins
/// anew.
pub struct TrajectoryEstimator {
    options: TrajectoryOptions,
    keyframes: Vec<Corrected>,
    odometry: DeadReckoning,
    loops: Vec<JudgedLoop>,
    estimator: Estimator,
}

/// A keyframe with its pose by odometry.
pub(crate) struct Corrected {
    pub seq: u64,
    pub odometry: Pose,
    motion: UncertainMotion,
    path_m: f64,
}

enum Estimator {
    Graph(Box<PoseGraph>),
    Filter(TrajectoryFilter),
}

impl Estimator {
    fn new(start: Pose, kind: EstimatorKind) -> Self {
        match kind {
            EstimatorKind::Graph => {
                Self::Graph(Box::new(PoseGraph::new(start, GraphOptions::default())))
            }
            EstimatorKind::Filter => {
                Self::Filter(TrajectoryFilter::new(start, FilterOptions::default()))
            }
        }
    }

    fn apply(&mut self, constraint: &Constraint) -> Result<Verdict, EstimationError> {
        match self {
            Self::Graph(graph) => graph.apply(constraint),
            Self::Filter(filter) => filter.apply(constraint),
        }
    }
}

impl TrajectoryEstimator {
    /// Starts without a keyframe.
    pub fn new(options: TrajectoryOptions) -> Self {
        Self {
            estimator: Estimator::new(Pose::identity(), options.kind),
            options,
            keyframes: Vec::new(),
            odometry: DeadReckoning::default(),
            loops: Vec::new(),
        }
    }

    /// Takes the next keyframe. The first one stays where odometry has it. Until the next solution, a keyframe continues from the one
    /// before by odometry.
    ///
    /// # Errors
    /// A motion without a usable covariance, or too many keyframes for the filter.
    pub fn push(&mut self, keyframe: &Keyframe) -> Result<(), EstimationError> {
        match self.keyframes.len().checked_sub(1) {
            None => {
                self.estimator = Estimator::new(keyframe.pose.motion, self.options.kind);
            }
            Some(last) => {
                let motion = Constraint::odometry(last, keyframe.motion);
                self.estimator.apply(&motion)?;
            }
        }
        self.odometry.push(&keyframe.motion);
        self.keyframes.push(Corrected {
            seq: keyframe.seq,
            odometry: keyframe.pose.motion,
            motion: keyframe.motion,
            path_m: keyframe.path_m,
        });
        Ok(())
    }

    /// Takes the accepted loops of a keyframe, for the next solution.
    ///
    /// # Errors
    /// Keyframes that were not pushed.
    pub fn close(&mut self, query: &Query) -> Result<(), EstimationError> {
        query
            .loops()
            .try_for_each(|(_, closing)| self.close_loop(&closing))
    }

    /// Takes a loop from an earlier to a later keyframe, for the next solution. Its group is decided by its keyframes.
    ///
    /// # Errors
    /// Keyframes that were not pushed.
    pub fn close_loop(&mut self, closing: &Constraint) -> Result<(), EstimationError> {
        let &Constraint { from, to, .. } = closing;
        let keyframes = self.keyframes.len();
        if from.max(to) >= keyframes {
            return Err(EstimationError::UnknownKeyframe {
                from,
                to,
                keyframes,
            });
        }
        let stretch =
            |keyframe: usize| (self.keyframes[keyframe].path_m / self.options.group_m) as u64;
        let group = Some(stretch(from) << 32 | stretch(to));
        self.loops.push(JudgedLoop {
            constraint: Constraint {
                kind: Kind::Loop { group },
                ..*closing
            },
            verdict: LoopVerdict::Used,
            weight: 1.0,
        });
        Ok(())
    }

    /// Moves all poses to where they fit best, and judges all loops anew.
    ///
    /// # Errors
    /// The equations have no solution.
    pub fn solve(&mut self) -> Result<(), EstimationError> {
        let by_keyframes = |it: &JudgedLoop| (it.constraint.to, it.constraint.from);
        self.loops.sort_by_key(by_keyframes);
        match self.options.kind {
            EstimatorKind::Graph => self.solve_graph(),
            EstimatorKind::Filter => self.filter(),
        }
    }

    /// Returns the poses of all keyframes in the frame of the first scan.
    pub fn poses(&self) -> &[Pose] {
        let poses = match &self.estimator {
            Estimator::Graph(graph) => graph.poses(),
            Estimator::Filter(filter) => filter.poses(),
        };
        &poses[..self.keyframes.len()]
    }

    /// Returns the pose of a keyframe with its covariance along the axes of the frame of the first scan.
    ///
    /// # Errors
    /// There is no such keyframe, or the constraints do not determine the poses.
    pub fn pose(&mut self, keyframe: usize) -> Result<UncertainMotion, EstimationError> {
        match &mut self.estimator {
            Estimator::Graph(graph) => graph.pose(keyframe),
            Estimator::Filter(filter) => filter.pose(keyframe),
        }
    }

    /// Returns all loops; after [`TrajectoryEstimator::solve`] by the later keyframe, then by the earlier one.
    pub fn loops(&self) -> &[JudgedLoop] {
        &self.loops
    }

    /// Returns the motions between the keyframes.
    pub fn odometry(&self) -> impl Iterator<Item = Constraint> + '_ {
        let motions = self.keyframes.iter().skip(1).enumerate();
        motions.map(|(last, keyframe)| Constraint::odometry(last, keyframe.motion))
    }

    /// Returns the correction of the poses of all scans.
    pub fn correction(&self) -> Correction {
        Correction::new(&self.keyframes, self.poses())
    }

    /// Starts an estimator with the first keyframe.
    fn start(&self) -> Estimator {
        let start = self.keyframes.first();
        let start = start.map_or(Pose::identity(), |first| first.odometry);
        Estimator::new(start, self.options.kind)
    }

    /// The graph of all keyframes, and of those loops that agree with odometry and with each other.
    fn solve_graph(&mut self) -> Result<(), EstimationError> {
        let mut estimator = self.start();
        let Estimator::Graph(graph) = &mut estimator else {
            return Ok(());
        };
        for motion in self.odometry() {
            graph.apply(&motion)?;
        }
        for it in &mut self.loops {
            it.verdict = match graph.test(&it.constraint)?.outcome {
                Outcome::Rejected => LoopVerdict::ContradictsOdometry,
                Outcome::Accepted | Outcome::Redundant => LoopVerdict::Used,
            };
        }
        self.reject_inconsistent();
        for it in used(&mut self.loops) {
            graph.apply(&it.constraint)?;
        }
        graph.solve_anew()?;
        self.weigh(&estimator);
        self.estimator = estimator;
        Ok(())
    }

    /// Notes the kernel's weights, which the graph returns by the earlier keyframe, then by the later one.
    fn weigh(&mut self, estimator: &Estimator) {
        let Estimator::Graph(graph) = estimator else {
            return;
        };
        self.loops.iter_mut().for_each(|it| it.weight = 0.0);
        let mut used = used(&mut self.loops);
        used.sort_by_key(|it| (it.constraint.from, it.constraint.to));
        for (it, weighted) in used.iter_mut().zip(graph.loops()) {
            it.weight = weighted.weight;
        }
    }

    fn reject_inconsistent(&mut self) {
        let mut used = used(&mut self.loops);
        let constraints: Vec<Constraint> = used.iter().map(|it| it.constraint).collect();
        let consistent = consistent(&self.odometry, &constraints);
        for (it, consistent) in used.iter_mut().zip(consistent) {
            if !consistent {
                it.verdict = LoopVerdict::ContradictsLoops;
            }
        }
    }

    /// The filter over keyframes and loops in the order of the drive: each loop when its later keyframe was just added.
    fn filter(&mut self) -> Result<(), EstimationError> {
        let mut estimator = self.start();
        let mut loops = self.loops.iter_mut().peekable();
        for (number, keyframe) in self.keyframes.iter().enumerate() {
            if let Some(last) = number.checked_sub(1) {
                estimator.apply(&Constraint::odometry(last, keyframe.motion))?;
            }
            while let Some(it) = loops.next_if(|it| it.constraint.to == number) {
                let outcome = estimator.apply(&it.constraint)?.outcome;
                (it.verdict, it.weight) = match outcome {
                    Outcome::Accepted => (LoopVerdict::Used, 1.0),
                    Outcome::Rejected => (LoopVerdict::ContradictsOdometry, 0.0),
                    Outcome::Redundant => (LoopVerdict::Redundant, 0.0),
                };
            }
        }
        self.estimator = estimator;
        Ok(())
    }
}

fn used(loops: &mut [JudgedLoop]) -> Vec<&mut JudgedLoop> {
    let used = |it: &&mut JudgedLoop| it.verdict == LoopVerdict::Used;
    loops.iter_mut().filter(used).collect()
}
