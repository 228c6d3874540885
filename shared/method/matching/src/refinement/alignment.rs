//! Alignment of a scan's points with the local map: Gauss-Newton over (x, y, yaw) with a line
//! search.

#[cfg(test)]
mod tests;

use gyre_geometry::Pose;
use nalgebra::{UnitVector2, Vector3};

use super::{
    map_level::MapView,
    normal_equations::{NormalEquations, linearise},
    points::DeskewedPoints,
};

/// Converged if a step is shorter than this in each unknown: m, m, rad.
const MIN_STEP: [f64; 3] = [5e-4, 5e-4, 1e-5];
/// Relative increase of the information's diagonal: keeps the equations solvable where points on
/// one line leave an unknown open.
const DAMPING: f64 = 1e-4;
/// Share of the first Gauss-Newton step that is taken. On a map, such a step is about three times
/// too long, see [`align`].
const FIRST_SHARE: f64 = 0.3;
/// The next share is within these factors of the last one.
const SHARE_FACTORS: (f64, f64) = (0.25, 4.0);

#[derive(Debug, Clone, Copy)]
pub(super) struct Alignment {
    /// Pose of the points' frame in the map.
    pub pose: Pose,
    pub normal: NormalEquations,
}

/// Aligns points with the map from an initial pose by Gauss-Newton steps with a line search. The
/// cost never rises.
///
/// Gauss-Newton takes the residuals for small. Here a point's residual 1 - M is large everywhere,
/// so the cost is curved several times as much as the information implies, and a whole step is too
/// long. The parabola through the cost and its slope before a step and the cost after it gives the
/// share of the step with the least cost. That share is nearly the same from step to step, so each
/// step takes the share that the one before would have needed, at one evaluation of the cost a
/// step.
///
/// With a `locked` direction along the map's axes the steps are across it, and turns.
pub(super) fn align(
    map: &MapView<'_>,
    points: &DeskewedPoints,
    initial: &Pose,
    max_iterations: usize,
    locked: Option<UnitVector2<f64>>,
) -> Alignment {
    let whole_step = |normal: &NormalEquations| match locked {
        Some(locked) => gauss_newton_step(&normal.without(&locked.push(0.0))),
        None => gauss_newton_step(normal),
    };
    let at = |pose: Pose| Alignment {
        normal: linearise(map, points, &pose),
        pose,
    };
    let mut best = at(*initial);
    let mut share = FIRST_SHARE;
    for _ in 0..max_iterations {
        let Some(whole) = whole_step(&best.normal) else {
            break;
        };
        let step = whole * share;
        let next = at(stepped(&best.pose, &step));
        share *= best_share(&best.normal, &step, &next.normal);
        if next.normal.cost < best.normal.cost {
            best = next;
        }
        if is_short(&step) {
            break;
        }
    }
    best
}

/// The step that solves the normal equations; `None` if they are singular.
fn gauss_newton_step(normal: &NormalEquations) -> Option<Vector3<f64>> {
    let mut damped = normal.information;
    for k in 0..3 {
        damped[(k, k)] *= 1.0 + DAMPING;
    }
    let step = damped.cholesky()?.solve(&normal.right_hand_side);
    step.iter().all(|s| s.is_finite()).then_some(step)
}

/// Returns the share of a step that minimises the parabola through the costs before and after it.
fn best_share(before: &NormalEquations, step: &Vector3<f64>, after: &NormalEquations) -> f64 {
    let (least, most) = SHARE_FACTORS;
    let descent = 2.0 * before.right_hand_side.dot(step);
    let curvature = after.cost - before.cost + descent;
    if curvature > 0.0 {
        (0.5 * descent / curvature).clamp(least, most)
    } else {
        most
    }
}

fn stepped(pose: &Pose, step: &Vector3<f64>) -> Pose {
    Pose::new(
        pose.translation.vector + step.xy(),
        pose.rotation.angle() + step.z,
    )
}

fn is_short(step: &Vector3<f64>) -> bool {
    step.iter().zip(MIN_STEP).all(|(s, min)| s.abs() < min)
}
