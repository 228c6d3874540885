//! The estimate for other programs, which have neither its kernel nor its groups.

use std::{collections::BTreeMap, fmt::Write};

use gyre_geometry::{Pose, UncertainMotion};
use nalgebra::{Matrix3, Vector3};

use super::{Estimator, TrajectoryEstimator};
use crate::estimation::{Constraint, G2o, Kind, PHI, PoseGraph, Position, WeightedPosition};

/// A fix measures no heading: its standard deviation in a constraint is a whole turn and more, rad.
const ANY_HEADING_RAD: f64 = 10.0;

impl TrajectoryEstimator {
    /// Returns a g2o file whose optimum by plain least squares are the poses of the keyframes:
    /// odometry, the loops that are used, and the fixes of GNSS as [`priors`]. Loops and fixes have
    /// the information of the last solution.
    pub fn g2o(&self) -> String {
        let Estimator::Graph(graph) = &self.estimator else {
            let used = self.loops.iter().filter(|it| it.is_used());
            let used = used.map(|it| it.constraint);
            return G2o::write(self.poses(), self.odometry().chain(used));
        };
        let priors = priors(graph);
        let constraints = self.odometry().chain(self.weighted_loops());
        let mut text = G2o::write(self.poses(), constraints.chain(priors.iter().copied()));
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "# robust kernel: dynamic covariance scaling, phi {PHI}. The information of each loop and fix is multiplied by its weight, and divided among those with dependent errors"
        );
        if !priors.is_empty() {
            let _ = writeln!(
                text,
                "{} {}: the last edges are positions by GNSS, as priors: edges from vertex 0, which is fixed",
                G2o::FIXES,
                priors.len()
            );
        }
        text
    }

    fn weighted_loops(&self) -> impl Iterator<Item = Constraint> {
        let used = self.loops.iter().filter(|it| it.is_used());
        let mut members = BTreeMap::<Kind, usize>::new();
        for it in used.clone() {
            *members.entry(it.constraint.kind).or_default() += 1;
        }
        used.map(move |it| {
            let mut constraint = it.constraint;
            let share = members[&constraint.kind] as f64;
            constraint.motion.covariance *= share / it.weight;
            constraint
        })
    }
}

/// Returns the positions that count as constraints from keyframe 0. A position of keyframe 0, which
/// is fixed, moves no pose.
fn priors(graph: &PoseGraph) -> Vec<Constraint> {
    let Some(frame) = graph.frame() else {
        return Vec::new();
    };
    let counts = |it: &WeightedPosition| it.weight > 0.0 && it.position.keyframe > 0;
    let positions = graph.positions().filter(counts);
    positions
        .map(|it| {
            let weight = it.position.share * it.weight;
            prior(graph.poses(), &frame, &it.position, weight)
        })
        .collect()
}

/// Returns a position as a constraint: the antenna is where it was measured, at any heading, and
/// the keyframe at the other end of the lever.
fn prior(poses: &[Pose], frame: &Pose, position: &Position, weight: f64) -> Constraint {
    let keyframe = position.keyframe;
    let heading = frame.rotation * poses[keyframe].rotation;
    let antenna = Pose::from_parts(position.position_m.into(), heading);
    let variance_m2 = position.variance_m2 / weight;
    let heading_rad2 = ANY_HEADING_RAD * ANY_HEADING_RAD;
    let antenna = UncertainMotion {
        motion: (frame * poses[0]).inv_mul(&antenna),
        covariance: Matrix3::from_diagonal(&Vector3::new(variance_m2, variance_m2, heading_rad2)),
    };
    let back = UncertainMotion {
        motion: Pose::translation(-position.lever_m.x, -position.lever_m.y),
        ..UncertainMotion::identity()
    };
    Constraint::closing(0, keyframe, antenna.then(&back))
}
