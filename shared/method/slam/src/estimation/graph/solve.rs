//! The solution of a pose graph: Gauss-Newton with reweighted loops, within a trust radius where a
//! step would raise the cost.

use gyre_geometry::{Pose, xy_yaw};
use nalgebra::DVector;

use super::{Closing, PoseGraph, Solution, State, dogleg::Dogleg, edge::Edge, system::System};
use crate::estimation::{EstimationError, relative::corrected};

/// Above this share of the predicted decrease of the cost the trust radius grows.
const GOOD_GAIN: f64 = 0.75;

const POOR_GAIN: f64 = 0.25;

/// A shorter step, in m and rad over all poses, goes nowhere: the poses are at a minimum but for
/// rounding.
const SHORTEST_STEP: f64 = 1e-12;

/// The tolerance of descents that only have to bring the poses near their place.
pub(super) const COARSE: f64 = 0.1;

/// True if loops keep their weights while the poses are moved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Weights {
    Kept,
    Kernel,
}

impl PoseGraph {
    /// Moves all poses to where they fit the constraints best, from where they are. New loops start
    /// with the weight of their test against the odometry; then the kernel decides. The result can
    /// depend on the order of arrival; [`PoseGraph::solve_anew`] does not. On an error the poses
    /// are unchanged.
    pub fn solve(&mut self) -> Result<Solution, EstimationError> {
        let before = self.state.clone();
        self.place_frame();
        let solved = self.descend(Weights::Kept, COARSE).and_then(|(first, _)| {
            let (then, converged) = self.descend(Weights::Kernel, self.options.tolerance)?;
            Ok((first + then, converged))
        });
        self.factorised = solved.is_ok();
        let (iterations, converged) = solved.inspect_err(|_| self.state = before)?;
        Ok(Solution {
            cost: self.cost(),
            iterations,
            converged,
        })
    }

    /// Solves the graph from the odometry alone. The result depends on the constraints, and not on
    /// the order of arrival of loops.
    pub fn solve_anew(&mut self) -> Result<Solution, EstimationError> {
        for edge in &self.odometry {
            let [from, to] = edge.ends;
            self.state.poses[to] = self.state.poses[from] * edge.motion.motion;
        }
        for closing in &mut self.loops {
            closing.weight = self.options.kernel.weight(closing.gate_chi_square);
        }
        self.loops.sort_by(|a, b| {
            let measured = |closing: &Closing| xy_yaw(&closing.edge.motion.motion);
            let by_motion = || {
                let pairs = measured(a).into_iter().zip(measured(b));
                pairs.fold(std::cmp::Ordering::Equal, |order, (a, b)| {
                    order.then(a.total_cmp(&b))
                })
            };
            a.edge.ends.cmp(&b.edge.ends).then_with(by_motion)
        });
        self.state.frame = None;
        self.forget_system();
        self.place_frame();
        if self.state.frame.is_some() {
            let before = self.state.clone();
            let chosen = self.choose_positions();
            chosen.inspect_err(|_| self.state = before)?;
        }
        self.solve()
    }

    pub(super) fn prepare(&mut self) -> Result<&mut System, EstimationError> {
        let system = match self.system.take() {
            Some(system) => system,
            None => {
                let keyframes = self.state.poses.len();
                let positions = self.positions.iter().filter(|_| self.state.frame.is_some());
                let positions = positions.map(|measured| measured.ends(keyframes));
                let ends = self.edges().map(|edge| edge.ends).chain(positions);
                let nodes = keyframes + usize::from(self.state.frame.is_some());
                System::new(nodes, &ends.collect::<Vec<_>>())
                    .map_err(|_| EstimationError::Memory { keyframes })?
            }
        };
        Ok(self.system.insert(system))
    }

    /// Factorises the equations, which must be those at the present poses.
    fn factorise(&mut self) -> Result<&System, EstimationError> {
        let done = self.prepare()?.factorise();
        match &self.system {
            Some(system) if done => Ok(system),
            _ => Err(EstimationError::Singular),
        }
    }

    pub(super) fn factorised(&mut self) -> Result<&System, EstimationError> {
        if !self.factorised {
            self.linearise(Weights::Kept)?;
            self.factorise()?;
            self.factorised = true;
        }
        self.system.as_ref().ok_or(EstimationError::Singular)
    }

    fn edges(&self) -> impl Iterator<Item = &Edge> {
        let loops = self.loops.iter().map(|closing| &closing.edge);
        self.odometry.iter().chain(loops)
    }

    /// Moves the poses until a full Gauss-Newton step lowers the cost by less than `tolerance` of
    /// it. Returns the number of linearisations, and whether this was reached.
    pub(super) fn descend(
        &mut self,
        weights: Weights,
        tolerance: f64,
    ) -> Result<(usize, bool), EstimationError> {
        let mut cost = self.chi_square(&self.state, weights);
        let mut radius = f64::INFINITY;
        for iteration in 1..=self.options.max_iterations {
            let gradient = self.linearise(weights)?;
            let dogleg = Dogleg::new(self.factorise()?, gradient);
            let Some((state, lower)) = self.step(&dogleg, weights, cost, &mut radius)? else {
                return Ok((iteration, true));
            };
            self.state = state;
            if dogleg.full_length() <= radius && cost - lower <= tolerance * cost {
                return Ok((iteration, true));
            }
            cost = lower;
        }
        Ok((self.options.max_iterations, false))
    }

    /// Returns a state whose cost is not above `cost`, with their cost; `None` without such a state
    /// nearby. Adapts the trust radius.
    fn step(
        &mut self,
        dogleg: &Dogleg,
        weights: Weights,
        cost: f64,
        radius: &mut f64,
    ) -> Result<Option<(State, f64)>, EstimationError> {
        while *radius > SHORTEST_STEP {
            let step = dogleg.within(*radius);
            let state = self.moved(&step);
            let lower = self.chi_square(&state, weights);
            let gain = (cost - lower) / dogleg.predicted(self.prepare()?, &step);
            if lower <= cost {
                if gain > GOOD_GAIN {
                    *radius *= 2.0;
                } else if gain < POOR_GAIN {
                    *radius = 0.5 * step.norm();
                }
                return Ok(Some((state, lower)));
            }
            *radius = 0.25 * step.norm();
        }
        match cost.is_finite() {
            true => Ok(None),
            false => Err(EstimationError::Singular),
        }
    }

    /// Puts the equations at the present poses into the system, and returns their right-hand side.
    fn linearise(&mut self, weights: Weights) -> Result<DVector<f64>, EstimationError> {
        self.prepare()?;
        let shares = self.loops.iter().map(|closing| self.share(closing));
        let shares = Vec::from_iter(shares);
        let Self {
            system: Some(system),
            state: State { poses, frame },
            odometry,
            loops,
            positions,
            options,
            ..
        } = self
        else {
            return Err(EstimationError::Singular);
        };
        system.clear();
        let mut side = system.right_hand_side();
        for (number, edge) in odometry.iter().enumerate() {
            let linear = edge.linearise(poses);
            system.add(number, edge.ends, &linear, 1.0, &mut side);
        }
        for (number, (closing, share)) in loops.iter_mut().zip(shares).enumerate() {
            let linear = closing.edge.linearise(poses);
            if weights == Weights::Kernel {
                closing.weight = options.kernel.weight(linear.chi_square);
            }
            let number = odometry.len() + number;
            let weight = share * closing.weight;
            system.add(number, closing.edge.ends, &linear, weight, &mut side);
        }
        let Some(frame) = frame else {
            return Ok(side);
        };
        for (number, measured) in positions.iter_mut().enumerate() {
            let linear = measured.linearise(poses, frame);
            if weights == Weights::Kernel {
                measured.weigh(&options.kernel, linear.chi_square);
            }
            let number = odometry.len() + loops.len() + number;
            let weight = measured.share() * measured.weight;
            let ends = measured.ends(poses.len());
            system.add(number, ends, &linear, weight, &mut side);
        }
        Ok(side)
    }

    /// Returns the sum of the squared normalised residuals in a state, with weights for loops and
    /// positions.
    pub(super) fn chi_square(&self, State { poses, frame }: &State, weights: Weights) -> f64 {
        let odometry = self.odometry.iter().map(|edge| edge.chi_square(poses));
        let loops = self.loops.iter().map(|closing| {
            let chi_square = closing.edge.chi_square(poses);
            self.share(closing)
                * match weights {
                    Weights::Kept => closing.weight * chi_square,
                    Weights::Kernel => self.options.kernel.cost(chi_square),
                }
        });
        let positions = frame.iter().flat_map(|frame| {
            self.positions.iter().map(move |measured| {
                let chi_square = measured.chi_square(poses, frame);
                measured.share() * measured.cost(chi_square, weights, &self.options.kernel)
            })
        });
        odometry.chain(loops).chain(positions).sum()
    }

    fn moved(&self, step: &DVector<f64>) -> State {
        let moved = |(node, pose): (usize, &Pose)| match System::row(node) {
            Some(row) => corrected(pose, &step.fixed_rows::<3>(row).into_owned()),
            None => *pose,
        };
        let State { poses, frame } = &self.state;
        State {
            poses: poses.iter().enumerate().map(moved).collect(),
            frame: frame.as_ref().map(|frame| moved((poses.len(), frame))),
        }
    }
}
