mod exchange;

use gyre_geometry::{Pose, UncertainMotion};
use nalgebra::Matrix3;

use crate::{
    Correction, JudgedLoop, Keyframe, LoopVerdict, Query,
    consistency::{DeadReckoning, Speakers},
    estimation::{
        Constraint, EstimationError, GraphOptions, Kind, Outcome, PoseGraph, TrajectoryFilter,
        Verdict, WeightedPosition,
    },
    fixes::{Fixes, Stamped},
    variance,
};

/// All loops are judged again when their number has grown by this share of it: that takes time in
/// proportion to it.
const GROWTH: usize = 8;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EstimatorKind {
    /// The pose graph: all poses by least squares.
    #[default]
    Graph,
    /// The extended Kalman filter over all poses, for short drives.
    Filter,
}

/// Loops between two stretches of the path of this length count as one: their errors are dependent,
/// m.
const GROUP_M: f64 = 5.0;

/// Estimates the poses of all keyframes from their motions and loops. The result of
/// [`TrajectoryEstimator::solve`] does not depend on when loops came; the result of
/// [`TrajectoryEstimator::update`], in a fraction of the time, may a little.
pub struct TrajectoryEstimator {
    kind: EstimatorKind,
    keyframes: Vec<Corrected>,
    odometry: DeadReckoning,
    /// By the later keyframe, then by the earlier one.
    loops: Vec<JudgedLoop>,
    /// The loops that the others were compared with when all were judged, and the number of loops
    /// at that time.
    speakers: Speakers,
    judged: usize,
    /// The fixes of GNSS, and the number of them when all were judged and when the standing
    /// estimate was made.
    fixes: Fixes,
    judged_fixes: usize,
    given_fixes: usize,
    /// Of the covariances of the poses.
    scale: f64,
    estimator: Estimator,
}

struct Corrected {
    seq: u64,
    at: Stamped,
    motion: UncertainMotion,
    noise: Matrix3<f64>,
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
                let limit = TrajectoryFilter::MAX_KEYFRAMES;
                Self::Filter(TrajectoryFilter::new(start, limit))
            }
        }
    }

    fn apply(&mut self, constraint: &Constraint) -> Result<Verdict, EstimationError> {
        match self {
            Self::Graph(graph) => graph.apply(constraint),
            Self::Filter(filter) => filter.apply(constraint),
        }
    }

    fn graph(&self) -> Option<&PoseGraph> {
        match self {
            Self::Graph(graph) => Some(graph),
            Self::Filter(_) => None,
        }
    }

    fn graph_mut(&mut self) -> Option<&mut PoseGraph> {
        match self {
            Self::Graph(graph) => Some(graph),
            Self::Filter(_) => None,
        }
    }

    fn take(&mut self, it: &mut JudgedLoop) -> Result<(), EstimationError> {
        (it.verdict, it.weight) = match self.apply(&it.constraint)?.outcome {
            Outcome::Accepted => (LoopVerdict::Used, 1.0),
            Outcome::Rejected => (LoopVerdict::ContradictsOdometry, 0.0),
            Outcome::Redundant => (LoopVerdict::Redundant, 0.0),
        };
        it.is_taken = true;
        Ok(())
    }
}

impl TrajectoryEstimator {
    pub fn new(kind: EstimatorKind) -> Self {
        Self {
            estimator: Estimator::new(Pose::identity(), kind),
            kind,
            keyframes: Vec::new(),
            odometry: DeadReckoning::default(),
            loops: Vec::new(),
            speakers: Speakers::default(),
            judged: 0,
            fixes: Fixes::default(),
            judged_fixes: 0,
            given_fixes: 0,
            scale: 1.0,
        }
    }

    /// Uses these fixes of GNSS: each when both keyframes around it have come. The filter ignores
    /// them.
    #[must_use]
    pub fn with_fixes(mut self, fixes: Fixes) -> Self {
        self.fixes = fixes;
        self
    }

    /// Uses these fixes in place of the earlier ones, as while a live receiver sends them. If the
    /// fixes of solved keyframes have changed, the next solution uses all fixes again. Returns
    /// whether the next solution has others.
    pub fn replace_fixes(&mut self, mut fixes: Fixes) -> bool {
        for (keyframe, ends) in self.keyframes.windows(2).enumerate() {
            fixes.advance(keyframe, ends[0].at, ends[1].at);
        }
        let before = &self.fixes.positions()[..self.given_fixes];
        let stand = fixes.positions().starts_with(before);
        let have_changed = !stand || fixes.settled() > self.given_fixes;
        if stand {
            fixes.go_on_from(&self.fixes);
        } else {
            if let Some(graph) = self.estimator.graph_mut() {
                graph.clear_positions();
            }
            (self.judged_fixes, self.given_fixes) = (0, 0);
        }
        self.fixes = fixes;
        have_changed
    }

    /// Takes the next keyframe. The first one stays where odometry has it. Until the next solution,
    /// a keyframe continues from the one before by odometry.
    pub fn push(&mut self, keyframe: &Keyframe) -> Result<(), EstimationError> {
        match self.keyframes.len().checked_sub(1) {
            None => {
                self.estimator = Estimator::new(keyframe.pose.motion, self.kind);
            }
            Some(last) => {
                let motion = Constraint::odometry(last, keyframe.motion);
                self.estimator.apply(&motion)?;
            }
        }
        self.odometry.push(&keyframe.motion);
        self.keyframes.push(Corrected {
            seq: keyframe.seq,
            at: Stamped {
                stamp_ns: keyframe.stamp_ns,
                odometry: keyframe.pose.motion,
            },
            motion: keyframe.motion,
            noise: keyframe.noise,
            path_m: keyframe.path_m,
        });
        if let [.., from, to] = self.keyframes.as_slice() {
            let keyframe = self.keyframes.len() - 2;
            self.fixes.advance(keyframe, from.at, to.at);
        }
        Ok(())
    }

    /// Takes the accepted loops of a keyframe, for the next solution. They were tested against the
    /// same odometry.
    pub fn close(&mut self, query: &Query) -> Result<(), EstimationError> {
        query
            .loops()
            .try_for_each(|(candidate, closing)| self.insert(&closing, candidate.chi_square))
    }

    /// Takes a loop from an earlier to a later keyframe, for the next solution. Its group is
    /// decided by its keyframes.
    pub fn close_loop(&mut self, closing: &Constraint) -> Result<(), EstimationError> {
        let chi_square = match self.estimator.graph() {
            Some(graph) => graph.test(closing)?.chi_square,
            None => 0.0,
        };
        self.insert(closing, chi_square)
    }

    /// Moves all poses to where they fit best, and judges all loops again.
    pub fn solve(&mut self) -> Result<(), EstimationError> {
        match self.kind {
            EstimatorKind::Graph => {
                self.judge_all();
                self.compare_clocks();
                self.solve_graph(self.fixes.taken())
            }
            EstimatorKind::Filter => self.filter(),
        }
    }

    /// Judges the loops that came since the last solution, and moves all poses from where they are
    /// to where they fit best. All loops are judged again from time to time, and if one was wrong
    /// the poses begin at the odometry.
    pub fn update(&mut self) -> Result<(), EstimationError> {
        match self.kind {
            EstimatorKind::Graph => self.update_graph(),
            EstimatorKind::Filter => self.update_filter(),
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

    /// Returns the pose of a keyframe with its covariance along the axes of the frame of the first
    /// scan.
    pub fn pose(&mut self, keyframe: usize) -> Result<UncertainMotion, EstimationError> {
        let mut pose = match &mut self.estimator {
            Estimator::Graph(graph) => graph.pose(keyframe)?,
            Estimator::Filter(filter) => filter.pose(keyframe)?,
        };
        pose.covariance *= self.scale;
        let turn = pose.motion.rotation.to_rotation_matrix().to_homogeneous();
        pose.covariance += turn * self.keyframes[keyframe].noise * turn.transpose();
        Ok(pose)
    }

    /// Scales the covariances of later poses so that they match the residuals of odometry and
    /// loops. Returns the scale, which is 1 without loops and in the filter. It takes some 1,400
    /// solutions of the equations.
    pub fn scale_covariances(&mut self) -> Result<f64, EstimationError> {
        self.scale = match self.estimator.graph_mut() {
            Some(graph) => variance::scale(graph, &self.odometry, &self.loops)?,
            None => 1.0,
        };
        Ok(self.scale)
    }

    pub fn loops(&self) -> &[JudgedLoop] {
        &self.loops
    }

    fn odometry(&self) -> impl Iterator<Item = Constraint> + '_ {
        let motions = self.keyframes.iter().skip(1).enumerate();
        motions.map(|(last, keyframe)| Constraint::odometry(last, keyframe.motion))
    }

    pub fn fixes(&self) -> &Fixes {
        &self.fixes
    }

    pub fn positions(&self) -> Vec<WeightedPosition> {
        let graph = self.estimator.graph();
        graph.map_or(Vec::new(), |graph| graph.positions().collect())
    }

    /// Returns the pose of the frame of the first scan in the frame of the fixes, east and north,
    /// with its covariance; `None` without fixes that determine it.
    pub fn east_north_from_map(&mut self) -> Result<Option<UncertainMotion>, EstimationError> {
        let frame = match self.estimator.graph_mut() {
            Some(graph) => graph.uncertain_frame()?,
            None => None,
        };
        Ok(frame.map(|frame| UncertainMotion {
            covariance: frame.covariance * self.scale,
            ..frame
        }))
    }

    pub fn correction(&self) -> Correction {
        let keyframes = self.keyframes.iter().map(|it| (it.seq, it.at.odometry));
        Correction::new(keyframes, self.poses())
    }

    fn start(&self) -> Estimator {
        let start = self.keyframes.first();
        let start = start.map_or(Pose::identity(), |first| first.at.odometry);
        Estimator::new(start, self.kind)
    }

    fn insert(&mut self, closing: &Constraint, chi_square: f64) -> Result<(), EstimationError> {
        let &Constraint { from, to, .. } = closing;
        let keyframes = self.keyframes.len();
        if from.max(to) >= keyframes {
            return Err(EstimationError::unknown([from, to], keyframes));
        }
        let stretch = |keyframe: usize| (self.keyframes[keyframe].path_m / GROUP_M) as u64;
        let group = Some(stretch(from) << 32 | stretch(to));
        let judged = JudgedLoop::new(
            Constraint {
                kind: Kind::Loop { group },
                ..*closing
            },
            chi_square,
        );
        let is_before = |it: &JudgedLoop| (it.constraint.to, it.constraint.from) <= (to, from);
        let place = self.loops.partition_point(is_before);
        self.loops.insert(place, judged);
        Ok(())
    }

    fn judge_all(&mut self) {
        self.loops
            .iter_mut()
            .for_each(JudgedLoop::judge_by_odometry);
        let used = self.loops.iter().filter(|it| it.is_used());
        let used: Vec<Constraint> = used.map(|it| it.constraint).collect();
        self.speakers = Speakers::choose(&self.odometry, &used);
        self.judged = self.loops.len();
        self.compare(|it| it.is_used());
    }

    fn compare(&mut self, some: impl Fn(&JudgedLoop) -> bool) {
        for it in self.loops.iter_mut().filter(|it| some(it)) {
            if !self.speakers.accept(&self.odometry, &it.constraint) {
                it.verdict = LoopVerdict::ContradictsLoops;
            }
        }
    }

    fn compare_clocks(&mut self) {
        let stamped: Vec<Stamped> = self.keyframes.iter().map(|it| it.at).collect();
        self.fixes.compare_clocks(&stamped);
        self.judged_fixes = self.fixes.taken();
    }

    /// Solves the graph with all loops that are used and so many fixes, from the odometry; without
    /// the fixes if most of them contradict the solution.
    fn solve_graph(&mut self, fixes: usize) -> Result<(), EstimationError> {
        let Some(graph) = self.estimator.graph_mut() else {
            return Ok(());
        };
        graph.clear_loops();
        graph.clear_positions();
        for it in &mut self.loops {
            it.is_taken = it.is_used();
            if it.is_taken {
                graph.apply_tested(&it.constraint, it.chi_square)?;
            }
        }
        self.given_fixes = fixes;
        let has_fixes = fixes > 0 && self.fixes.refusal().is_none();
        if has_fixes {
            self.fixes.give(graph, 0..fixes)?;
        }
        graph.solve_anew()?;
        if has_fixes {
            self.fixes.check(graph);
        }
        if has_fixes && self.fixes.refusal().is_some() {
            graph.clear_positions();
            graph.solve_anew()?;
        }
        self.weigh();
        Ok(())
    }

    /// Solves the graph with the loops and fixes that are new and used, from the standing poses.
    fn update_graph(&mut self) -> Result<(), EstimationError> {
        let settled = self.fixes.settled().max(self.given_fixes);
        let has_grown = |now: usize, judged: usize| now > judged + judged / GROWTH;
        match has_grown(self.loops.len(), self.judged) {
            true => self.judge_all(),
            false => self.compare(|it| it.is_used() && !it.is_taken),
        }
        let standing = self.loops.iter().filter(|it| it.is_taken).count();
        let new = |it: &&mut JudgedLoop| it.is_used() && !it.is_taken;
        let is_withdrawn = self.loops.iter().any(|it| it.is_taken && !it.is_used());
        let are_fixes_judged = has_grown(self.fixes.taken(), self.judged_fixes);
        if are_fixes_judged {
            self.compare_clocks();
        }
        if are_fixes_judged || is_withdrawn || self.loops.iter_mut().filter(new).count() > standing
        {
            return self.solve_graph(settled);
        }
        let Some(graph) = self.estimator.graph_mut() else {
            return Ok(());
        };
        for it in self.loops.iter_mut().filter(new) {
            graph.apply_tested(&it.constraint, it.chi_square)?;
            it.is_taken = true;
        }
        if self.fixes.refusal().is_none() {
            self.fixes.give(graph, self.given_fixes..settled)?;
        }
        self.given_fixes = settled;
        graph.solve()?;
        self.weigh();
        Ok(())
    }

    fn weigh(&mut self) {
        let Some(graph) = self.estimator.graph() else {
            return;
        };
        let mut weights: Vec<_> = graph
            .loops()
            .map(|it| ((it.to, it.from), it.weight))
            .collect();
        weights.sort_by_key(|(ends, _)| *ends);
        self.loops.iter_mut().for_each(|it| it.weight = 0.0);
        let used = self.loops.iter_mut().filter(|it| it.is_used());
        for (it, (_, weight)) in used.zip(weights) {
            it.weight = weight;
        }
    }

    /// The filter over keyframes and loops in the order of the drive: each loop when its later
    /// keyframe was just added.
    fn filter(&mut self) -> Result<(), EstimationError> {
        let mut estimator = self.start();
        let mut loops = self.loops.iter_mut().peekable();
        for (number, keyframe) in self.keyframes.iter().enumerate() {
            if let Some(last) = number.checked_sub(1) {
                estimator.apply(&Constraint::odometry(last, keyframe.motion))?;
            }
            while let Some(it) = loops.next_if(|it| it.constraint.to == number) {
                estimator.take(it)?;
            }
        }
        self.estimator = estimator;
        Ok(())
    }

    fn update_filter(&mut self) -> Result<(), EstimationError> {
        let new = self.loops.iter_mut().filter(|it| !it.is_taken);
        for it in new {
            self.estimator.take(it)?;
        }
        Ok(())
    }
}
