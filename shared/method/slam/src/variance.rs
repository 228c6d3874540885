//! The scale of covariances, from the residuals of an estimate: the variance of unit weight.

use std::collections::BTreeSet;

use crate::{
    JudgedLoop,
    consistency::DeadReckoning,
    estimation::{EstimationError, Kind, PoseGraph},
};

/// Lengths of the stretches whose odometry is compared with the corrected poses, in keyframes.
const LENGTHS: [usize; 9] = [1, 2, 5, 10, 20, 50, 100, 200, 500];
const STRETCHES: usize = 150;
/// The weight of the prior 1 in residuals: a few loops change the scale little.
const PRIOR: f64 = 15.0;

/// Squared normalised residuals, and their sum as the covariances expect it, both over three
/// degrees of freedom.
struct Residuals {
    sum: f64,
    expected: f64,
}

impl Residuals {
    fn scale(&self) -> f64 {
        (PRIOR + self.sum) / (PRIOR + self.expected)
    }
}

/// Returns the scale of the covariances of the poses of a solved graph with `loops`: the largest of
/// the whole graph's scale and the odometry's scales over stretches of some lengths, because the
/// errors of odometry add up over some lengths of the path, and cancel over others.
pub fn scale(
    graph: &mut PoseGraph,
    odometry: &DeadReckoning,
    loops: &[JudgedLoop],
) -> Result<f64, EstimationError> {
    let mut largest = whole(graph, loops).scale();
    for length in LENGTHS {
        if 2 * length < graph.poses().len() {
            largest = largest.max(stretches(graph, odometry, length)?.scale());
        }
    }
    Ok(largest)
}

/// The residuals of all constraints. There are as many more constraints than poses as there are
/// groups of loops, and two for each fix that counts, less three for the frame of the fixes.
fn whole(graph: &PoseGraph, loops: &[JudgedLoop]) -> Residuals {
    let used = loops.iter().filter(|it| it.is_used());
    let groups: BTreeSet<Kind> = used.map(|it| it.constraint.kind).collect();
    let fixes = graph.positions().filter(|it| it.weight > 0.0);
    let fixes: f64 = fixes.map(|it| it.position.share).sum();
    Residuals {
        sum: 2.0 * graph.cost() / 3.0,
        expected: groups.len() as f64 + (2.0 * fixes / 3.0 - 1.0).max(0.0),
    }
}

/// The residuals of the odometry over stretches of `length` keyframes. With the covariance Q of the
/// odometry and P of the corrected motion, their difference has the covariance Q - P, and its
/// expected square, normalised by Q, is the trace of 1 - P / Q.
fn stretches(
    graph: &mut PoseGraph,
    odometry: &DeadReckoning,
    length: usize,
) -> Result<Residuals, EstimationError> {
    let ends = graph.poses().len() - length;
    let mut residuals = Residuals {
        sum: 0.0,
        expected: 0.0,
    };
    for from in (0..ends).step_by(ends.div_ceil(STRETCHES)) {
        let measured = odometry.motion(from, from + length);
        let corrected = graph.predict(from, from + length)?;
        let Some(information) = measured.covariance.try_inverse() else {
            continue;
        };
        let residual = measured.error(&corrected.motion);
        residuals.sum += residual.dot(&(information * residual)) / 3.0;
        residuals.expected += 1.0 - (information * corrected.covariance).trace() / 3.0;
    }
    Ok(residuals)
}
