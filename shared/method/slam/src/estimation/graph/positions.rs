//! Measured positions of keyframes in a frame of their own, for example by GNSS, and the pose of
//! the graph's frame in it.

use gyre_geometry::{Pose, UncertainMotion};
use nalgebra::{Matrix2x3, Matrix3, Vector2};

use super::{
    PoseGraph, State,
    edge::{Ends, Linear},
    solve::{COARSE, Weights},
};
use crate::estimation::{
    EstimationError,
    constraint::{CHI_SQUARE_99_9_PLANE, keyframe_exists},
    kernel::Kernel,
};

/// The heading of the graph's frame must be known to this standard deviation before positions move
/// any pose, rad: linearised equations hold within it.
const MAX_YAW_SIGMA: f64 = 0.2;
/// Scales of the kernel, each half of the one before, at most: from 10^18 times the gate.
const MAX_SCALES: usize = 60;

/// A measured position of a point that a keyframe carries, as of an antenna.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Position {
    pub keyframe: usize,
    /// The point in the frame of the keyframe, m.
    pub lever_m: Vector2<f64>,
    /// The measured position in the frame of the positions, m.
    pub position_m: Vector2<f64>,
    pub variance_m2: f64,
    /// The factor of its information, above 0 up to 1: less than 1 if its error depends on other
    /// errors.
    pub share: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WeightedPosition {
    pub position: Position,
    /// Squared normalised difference from the estimate; 2 is expected of a right one.
    pub chi_square: f64,
    /// The kernel's weight, 0 to 1; 0 if it is beyond the gate.
    pub weight: f64,
}

pub(super) struct Measured {
    it: Position,
    pub(super) weight: f64,
    is_refused: bool,
}

impl Measured {
    pub(super) fn share(&self) -> f64 {
        self.it.share
    }

    pub(super) fn ends(&self, keyframes: usize) -> Ends {
        [self.it.keyframe, keyframes]
    }

    pub(super) fn weigh(&mut self, kernel: &Kernel, chi_square: f64) {
        self.weight = match self.is_refused {
            true => 0.0,
            false => kernel.weight(chi_square),
        };
    }

    /// Returns its part of the cost, times two, without its share.
    pub(super) fn cost(&self, chi_square: f64, weights: Weights, kernel: &Kernel) -> f64 {
        match weights {
            _ if self.is_refused => 0.0,
            Weights::Kept => self.weight * chi_square,
            Weights::Kernel => kernel.cost(chi_square),
        }
    }

    pub(super) fn chi_square(&self, poses: &[Pose], frame: &Pose) -> f64 {
        let in_graph = poses[self.it.keyframe] * nalgebra::Point2::from(self.it.lever_m);
        let residual = self.it.position_m - (frame * in_graph).coords;
        residual.norm_squared() / self.it.variance_m2
    }

    pub(super) fn linearise(&self, poses: &[Pose], frame: &Pose) -> Linear {
        let pose = &poses[self.it.keyframe];
        let along = pose.rotation * self.it.lever_m;
        let in_graph = pose.translation.vector + along;
        let turn = frame.rotation.to_rotation_matrix().into_inner();
        let turned = |lever: Vector2<f64>| turn * Vector2::new(-lever.y, lever.x);
        let rows = |by_place: nalgebra::Matrix2<f64>, by_yaw: Vector2<f64>| {
            Matrix2x3::from_columns(&[
                by_place.column(0).into_owned(),
                by_place.column(1).into_owned(),
                by_yaw,
            ])
        };
        let a = rows(turn, turned(along));
        let b = rows(nalgebra::Matrix2::identity(), turned(in_graph));
        let residual = self.it.position_m - (turn * in_graph + frame.translation.vector);
        let information = 1.0 / self.it.variance_m2;
        Linear {
            blocks: [
                information * a.transpose() * a,
                information * b.transpose() * b,
            ],
            between: information * a.transpose() * b,
            sides: [
                information * a.transpose() * residual,
                information * b.transpose() * residual,
            ],
            chi_square: information * residual.norm_squared(),
        }
    }
}

impl PoseGraph {
    /// Takes a measured position. Positions move no pose until [`PoseGraph::solve`], nor before
    /// they determine the heading of the frame.
    pub fn measure(&mut self, position: Position) -> Result<(), EstimationError> {
        let keyframe = position.keyframe;
        keyframe_exists(keyframe, self.state.poses.len())?;
        let is_finite = |vector: &Vector2<f64>| vector.iter().all(|it| it.is_finite());
        let is_usable = is_finite(&position.lever_m)
            && is_finite(&position.position_m)
            && (f64::MIN_POSITIVE..f64::INFINITY).contains(&position.variance_m2)
            && (f64::MIN_POSITIVE..=1.0).contains(&position.share);
        if !is_usable {
            return Err(EstimationError::Refused(format!(
                "the position measured at keyframe {keyframe} is not finite, or its variance or share is not above zero"
            )));
        }
        self.positions.push(Measured {
            it: position,
            weight: 1.0,
            is_refused: false,
        });
        self.forget_system();
        Ok(())
    }

    pub fn clear_positions(&mut self) {
        self.positions.clear();
        self.state.frame = None;
        self.forget_system();
    }

    /// Returns the pose of the graph's frame in the frame of the positions; `None` if they do not
    /// determine it.
    pub fn frame(&self) -> Option<Pose> {
        self.state.frame
    }

    pub fn uncertain_frame(&mut self) -> Result<Option<UncertainMotion>, EstimationError> {
        let Some(motion) = self.state.frame else {
            return Ok(None);
        };
        let node = self.state.poses.len();
        let covariance = self.project(&[(node, Matrix3::identity())])?;
        Ok(Some(UncertainMotion { motion, covariance }))
    }

    /// Returns all positions in the order of arrival; before the frame is known, their weight is
    /// zero.
    pub fn positions(&self) -> impl Iterator<Item = WeightedPosition> + '_ {
        let State { poses, frame } = &self.state;
        self.positions.iter().map(move |measured| WeightedPosition {
            position: measured.it,
            chi_square: frame.map_or(f64::NAN, |frame| measured.chi_square(poses, &frame)),
            weight: frame.map_or(0.0, |_| measured.weight),
        })
    }

    /// Finds the pose of the frame by the present poses, unless it is known.
    pub(super) fn place_frame(&mut self) {
        if self.state.frame.is_none() {
            let positions = self.positions.iter().map(|measured| &measured.it);
            self.state.frame = align(&self.state.poses, positions);
            if self.state.frame.is_some() {
                self.forget_system();
            }
        }
    }

    /// Weighs the positions against each other and the rest, from poses that know nothing of them:
    /// graduated non-convexity (Yang et al., RA-L 2020). With a wide kernel all count alike, and
    /// the poses follow most of them; as it narrows those that contradict lose their weight.
    /// Positions beyond the gate at the end are not used.
    pub(super) fn choose_positions(&mut self) -> Result<(), EstimationError> {
        for measured in &mut self.positions {
            (measured.weight, measured.is_refused) = (1.0, false);
        }
        self.descend(Weights::Kept, COARSE)?;
        let widest = self.chi_squares().fold(CHI_SQUARE_99_9_PLANE, f64::max);
        let mut scale = widest;
        for _ in 0..MAX_SCALES {
            let kernel = Kernel::GemanMcClure { scale };
            self.reweigh(&kernel, f64::INFINITY);
            self.descend(Weights::Kept, COARSE)?;
            if scale <= CHI_SQUARE_99_9_PLANE {
                break;
            }
            scale = (0.5 * scale).max(CHI_SQUARE_99_9_PLANE);
        }
        let kernel = self.options.kernel;
        self.reweigh(&kernel, CHI_SQUARE_99_9_PLANE);
        Ok(())
    }

    fn reweigh(&mut self, kernel: &Kernel, gate: f64) {
        let chi_squares: Vec<f64> = self.chi_squares().collect();
        for (measured, chi_square) in self.positions.iter_mut().zip(chi_squares) {
            measured.is_refused = chi_square > gate;
            measured.weigh(kernel, chi_square);
        }
    }

    fn chi_squares(&self) -> impl Iterator<Item = f64> + '_ {
        let State { poses, frame } = &self.state;
        let frames = frame.iter();
        frames.flat_map(move |frame| {
            let positions = self.positions.iter();
            positions.map(move |measured| measured.chi_square(poses, frame))
        })
    }
}

/// A measured point in both frames.
struct Pair {
    weight: f64,
    at: Vector2<f64>,
    position: Vector2<f64>,
}

/// Returns the pose of the poses' frame in the positions' frame that fits best, by weighted least
/// squares (Umeyama, PAMI 1991, without scale); `None` if its heading is not known well enough.
pub fn align<'a>(
    poses: &[Pose],
    positions: impl IntoIterator<Item = &'a Position>,
) -> Option<Pose> {
    let pair = |it: &Position| {
        let pose = &poses[it.keyframe];
        Pair {
            weight: it.share / it.variance_m2,
            at: pose.translation.vector + pose.rotation * it.lever_m,
            position: it.position_m,
        }
    };
    let pairs: Vec<Pair> = positions.into_iter().map(pair).collect();
    let total: f64 = pairs.iter().map(|pair| pair.weight).sum();
    if !(total > 0.0 && total.is_finite()) {
        return None;
    }
    let mean = |of: fn(&Pair) -> Vector2<f64>| {
        let sum: Vector2<f64> = pairs.iter().map(|pair| pair.weight * of(pair)).sum();
        sum / total
    };
    let (from, to) = (mean(|pair| pair.at), mean(|pair| pair.position));
    let (mut cos, mut sin, mut spread) = (0.0, 0.0, 0.0);
    for pair in &pairs {
        let (a, b) = (pair.at - from, pair.position - to);
        cos += pair.weight * a.dot(&b);
        sin += pair.weight * a.perp(&b);
        spread += pair.weight * a.norm_squared();
    }
    if spread * MAX_YAW_SIGMA * MAX_YAW_SIGMA < 1.0 {
        return None;
    }
    let rotation = nalgebra::UnitComplex::new(sin.atan2(cos));
    Some(Pose::from_parts((to - rotation * from).into(), rotation))
}
