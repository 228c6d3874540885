//! The pose graph: all poses by least squares over sparse constraints.

mod cholesky;
mod covariance;
mod dogleg;
mod edge;
mod positions;
mod solve;
mod system;

use std::collections::BTreeMap;

use edge::Edge;
use gyre_geometry::{Pose, UncertainMotion};
use positions::Measured;

use crate::estimation::{
    CHI_SQUARE_99_9, Constraint, EstimationError, Kind, Outcome, Verdict, constraint::chi_square,
    kernel::Kernel, relative::Relative,
};
pub use positions::{Position, WeightedPosition, align};
use solve::Weights;
use system::System;

/// A loop keeps its weight up to this chi-square.
pub(crate) const PHI: f64 = 0.25 * CHI_SQUARE_99_9;

#[derive(Debug, Clone, PartialEq)]
pub struct GraphOptions {
    /// A loop whose chi-square against the odometry is larger is rejected.
    pub gate: f64,
    /// The weight of a loop that disagrees with the other constraints.
    pub kernel: Kernel,
    pub max_iterations: usize,
    /// A solution is found when a step lowers the cost by less than this share of it.
    pub tolerance: f64,
}

impl Default for GraphOptions {
    fn default() -> Self {
        Self {
            gate: CHI_SQUARE_99_9,
            kernel: Kernel::DynamicCovarianceScaling { phi: PHI },
            max_iterations: 100,
            tolerance: 1e-5,
        }
    }
}

/// The pose graph: the poses of all keyframes that fit odometry and loops best, by sparse least
/// squares. Each loop is tested against the odometry alone when it comes, and all loops against
/// each other by the kernel when the graph is solved.
pub struct PoseGraph {
    options: GraphOptions,
    state: State,
    odometry: Vec<Edge>,
    loops: Vec<Closing>,
    groups: BTreeMap<u64, usize>,
    positions: Vec<Measured>,
    system: Option<System>,
    /// True if the system is factorised, undamped, at the present poses.
    factorised: bool,
}

#[derive(Clone)]
struct State {
    poses: Vec<Pose>,
    /// The pose of the graph's frame in the frame of the positions; `None` without positions that
    /// determine it. In the equations it follows the poses.
    frame: Option<Pose>,
}

struct Closing {
    edge: Edge,
    group: Option<u64>,
    gate_chi_square: f64,
    weight: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WeightedLoop {
    pub from: usize,
    pub to: usize,
    /// Squared normalised difference of the measured motion from the estimate; 3 is expected of a
    /// right loop.
    pub chi_square: f64,
    /// The kernel's weight at the last solution, from 0 to 1.
    pub weight: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Solution {
    /// Half the sum of the squared normalised residuals, with loops after the kernel.
    pub cost: f64,
    pub iterations: usize,
    /// True if the poses are at a minimum of the cost. If not, the iterations were too few, and a
    /// further solution continues from there.
    pub converged: bool,
}

impl PoseGraph {
    /// Creates a graph with keyframe 0 at `start`, known exactly.
    pub fn new(start: Pose, options: GraphOptions) -> Self {
        Self {
            options,
            state: State {
                poses: vec![start],
                frame: None,
            },
            odometry: Vec::new(),
            loops: Vec::new(),
            groups: BTreeMap::new(),
            positions: Vec::new(),
            system: None,
            factorised: false,
        }
    }

    /// Takes a constraint: an odometry constraint adds a keyframe where it leads, a loop is tested
    /// against the odometry between its keyframes. Loops correct no pose until
    /// [`PoseGraph::solve`].
    pub fn apply(&mut self, constraint: &Constraint) -> Result<Verdict, EstimationError> {
        let Kind::Odometry = constraint.kind else {
            let tested = self.test(constraint)?;
            return self.apply_tested(constraint, tested.chi_square);
        };
        let edge = self.edge(constraint)?;
        let end = self.state.poses[constraint.from] * constraint.motion.motion;
        self.state.poses.push(end);
        self.odometry.push(edge);
        self.forget_system();
        Ok(Verdict {
            chi_square: 0.0,
            outcome: Outcome::Accepted,
        })
    }

    /// Takes a loop as [`PoseGraph::apply`] does, whose chi-square is known from an earlier
    /// [`PoseGraph::test`]: that takes time in proportion to the path between the keyframes, and
    /// the odometry between them does not change.
    pub fn apply_tested(
        &mut self,
        constraint: &Constraint,
        chi_square: f64,
    ) -> Result<Verdict, EstimationError> {
        let Kind::Loop { group } = constraint.kind else {
            return self.apply(constraint);
        };
        let edge = self.edge(constraint)?;
        let verdict = self.verdict(chi_square);
        if verdict.outcome == Outcome::Accepted {
            self.insert(edge, group, chi_square);
            self.forget_system();
        }
        Ok(verdict)
    }

    /// Tests a loop against the odometry between its keyframes, as [`PoseGraph::apply`] does,
    /// without taking it.
    pub fn test(&self, constraint: &Constraint) -> Result<Verdict, EstimationError> {
        let edge = self.edge(constraint)?;
        Ok(self.verdict(self.against_odometry(&edge)))
    }

    pub fn clear_loops(&mut self) {
        self.loops.clear();
        self.groups.clear();
        self.forget_system();
    }

    /// Returns the poses of all keyframes, as last solved; those added since continue from there by
    /// odometry.
    pub fn poses(&self) -> &[Pose] {
        &self.state.poses
    }

    /// Moves all poses, for instance to the poses of a file, as the start of the next solution. The
    /// first pose stays fixed where it is put.
    pub fn start_from(&mut self, poses: &[Pose]) -> Result<(), EstimationError> {
        if poses.len() != self.state.poses.len() {
            let (poses, keyframes) = (poses.len(), self.state.poses.len());
            return Err(EstimationError::Refused(format!(
                "there are {poses} poses to start from, and {keyframes} keyframes: each keyframe needs one"
            )));
        }
        self.state.poses.copy_from_slice(poses);
        self.factorised = false;
        Ok(())
    }

    /// Returns half the sum of the squared normalised residuals at the present poses, with loops
    /// after the kernel.
    pub fn cost(&self) -> f64 {
        0.5 * self.chi_square(&self.state, Weights::Kernel)
    }

    /// Returns all loops that passed the gate, in the order of arrival, or by keyframes after
    /// [`PoseGraph::solve_anew`].
    pub fn loops(&self) -> impl Iterator<Item = WeightedLoop> + '_ {
        self.loops.iter().map(|closing| {
            let [from, to] = closing.edge.ends;
            WeightedLoop {
                from,
                to,
                chi_square: closing.edge.chi_square(&self.state.poses),
                weight: closing.weight,
            }
        })
    }

    /// Returns the constraints that are part of the graph: odometry, then loops as in
    /// [`PoseGraph::loops`].
    pub fn constraints(&self) -> impl Iterator<Item = Constraint> + '_ {
        let constraint = |edge: &Edge, kind| Constraint {
            from: edge.ends[0],
            to: edge.ends[1],
            motion: edge.motion,
            kind,
        };
        let loops = self.loops.iter().map(move |closing| {
            let group = closing.group;
            constraint(&closing.edge, Kind::Loop { group })
        });
        let odometry = self.odometry.iter();
        odometry
            .map(move |edge| constraint(edge, Kind::Odometry))
            .chain(loops)
    }

    fn edge(&self, constraint: &Constraint) -> Result<Edge, EstimationError> {
        constraint.check(self.state.poses.len())?;
        let ends = [constraint.from, constraint.to];
        Edge::new(ends, constraint.motion).ok_or(EstimationError::Singular)
    }

    fn forget_system(&mut self) {
        self.system = None;
        self.factorised = false;
    }

    fn against_odometry(&self, edge: &Edge) -> f64 {
        let [from, to] = edge.ends;
        let chain = self.odometry[from.min(to)..from.max(to)]
            .iter()
            .fold(UncertainMotion::identity(), |chain, motion| {
                chain.then(&motion.motion)
            });
        let (ends, end) = match from < to {
            true => ([Pose::identity(), chain.motion], 1),
            false => ([chain.motion, Pose::identity()], 0),
        };
        let relative = Relative::predict(&ends[0], &ends[1]);
        let jacobian = [relative.by_from, relative.by_to][end];
        let predicted = jacobian * chain.covariance * jacobian.transpose();
        let innovation = edge.motion.error(&relative.motion);
        chi_square(&innovation, &(predicted + edge.motion.covariance))
    }

    fn verdict(&self, chi_square: f64) -> Verdict {
        let outcome = match chi_square <= self.options.gate {
            true => Outcome::Accepted,
            false => Outcome::Rejected,
        };
        Verdict {
            chi_square,
            outcome,
        }
    }

    fn insert(&mut self, edge: Edge, group: Option<u64>, gate_chi_square: f64) {
        if let Some(group) = group {
            *self.groups.entry(group).or_default() += 1;
        }
        self.loops.push(Closing {
            edge,
            group,
            gate_chi_square,
            weight: self.options.kernel.weight(gate_chi_square),
        });
    }

    /// Returns how much a loop counts because of others of its group, which count as one together.
    fn share(&self, closing: &Closing) -> f64 {
        let members = closing.group.map_or(1, |group| self.groups[&group]);
        1.0 / members as f64
    }
}
