//! Alignment of a scan's points with the local map: Levenberg-Marquardt over (x, y, yaw).

#[cfg(test)]
mod tests;

use gyre_geometry::Pose;
use nalgebra::Vector3;

use super::{
    map_level::MapView,
    normal_equations::{NormalEquations, linearise},
    points::DeskewedPoints,
};

/// Converged if a step is shorter than this in each unknown: m, m, rad.
const MIN_STEP: [f64; 3] = [1e-3, 1e-3, 2e-5];
const INITIAL_DAMPING: f64 = 1e-3;
const MIN_DAMPING: f64 = 1e-4;
const MAX_DAMPING: f64 = 1e4;
const DAMPING_DECREASE: f64 = 0.3;
const DAMPING_INCREASE: f64 = 8.0;
/// The result of an alignment.
#[derive(Debug, Clone, Copy)]
pub(super) struct Alignment {
    /// Pose of the points' frame in the map.
    pub pose: Pose,
    /// The normal equations there.
    pub normal: NormalEquations,
}

/// Aligns points with the map from an initial pose. The cost never rises.
pub(super) fn align(
    map: &MapView<'_>,
    points: &DeskewedPoints,
    initial: &Pose,
    max_iterations: usize,
) -> Alignment {
    let at = |pose: Pose| Alignment {
        normal: linearise(map, points, &pose),
        pose,
    };
    let mut best = at(*initial);
    let mut damping = INITIAL_DAMPING;
    for _ in 0..max_iterations {
        let Some(step) = damped_step(&best.normal, damping) else {
            break;
        };
        let next = at(stepped(&best.pose, &step));
        if next.normal.cost < best.normal.cost {
            best = next;
            damping = (DAMPING_DECREASE * damping).max(MIN_DAMPING);
            if has_converged(&step) {
                break;
            }
        } else {
            damping *= DAMPING_INCREASE;
            if damping > MAX_DAMPING {
                break;
            }
        }
    }
    best
}

/// The step that solves the damped normal equations; `None` if they are singular.
fn damped_step(normal: &NormalEquations, damping: f64) -> Option<Vector3<f64>> {
    let mut damped = normal.information;
    for k in 0..3 {
        damped[(k, k)] *= 1.0 + damping;
    }
    let step = damped.cholesky()?.solve(&normal.right_hand_side);
    step.iter().all(|s| s.is_finite()).then_some(step)
}

fn stepped(pose: &Pose, step: &Vector3<f64>) -> Pose {
    Pose::new(
        pose.translation.vector + step.xy(),
        pose.rotation.angle() + step.z,
    )
}

fn has_converged(step: &Vector3<f64>) -> bool {
    step.iter().zip(MIN_STEP).all(|(s, min)| s.abs() < min)
}
