//! The place of a whole drive in a map.
//!
//! The keyframes of the drive are found in the map one by one. A pose graph of these places and of
//! the drive's own motions and loops gives all poses of the drive; the map stays where it is.

use std::collections::HashSet;

use gyre_geometry::{Pose, UncertainMotion};
use nalgebra::{Matrix3, Vector3};

use crate::{
    Keyframe,
    estimation::{
        CHI_SQUARE_99_9, Constraint, EstimationError, G2o, GraphOptions, Kind, PoseGraph,
    },
    localisation::{Fix, Localiser},
};

/// Fixes along so many metres of the path count as one, and so do loops between two such stretches:
/// their errors are dependent.
const DEPENDENT_M: f64 = 5.0;
/// The stretch that stands for the map in the groups of fixes.
const OF_MAP: u64 = u32::MAX as u64;
/// The uncertainty of the first pose before any fix: standard deviations in m and rad.
const ANYWHERE: [f64; 3] = [1e5, 1e5, 3.0];
const STARTS: usize = 100;

#[derive(Clone, Copy, Debug)]
pub struct FoundKeyframe {
    pub keyframe: usize,
    pub fix: Fix,
}

#[derive(Clone, Debug, Default)]
pub struct DriveSearch {
    found: Vec<FoundKeyframe>,
    stretches: Vec<u64>,
}

#[derive(Clone, Debug)]
pub struct PlacedDrive {
    pub poses: Vec<Pose>,
    pub agreeing: Vec<FoundKeyframe>,
}

impl DriveSearch {
    /// Looks for the next keyframe of the drive, independently: the result of tracking depends on
    /// earlier results.
    pub fn add(&mut self, localiser: &mut Localiser, keyframe: &Keyframe) {
        let number = self.stretches.len();
        self.stretches.push((keyframe.path_m / DEPENDENT_M) as u64);
        // The velocity of the first scan is not known, so that its points do not fit.
        if number > 0 {
            let fix = localiser.find(&keyframe.points, &keyframe.twist);
            let found = fix.map(|fix| FoundKeyframe {
                keyframe: number,
                fix,
            });
            self.found.extend(found);
        }
    }

    pub fn found(&self) -> &[FoundKeyframe] {
        &self.found
    }

    /// Returns the poses of the drive in the map frame that fit its motions, its loops and its
    /// places on the map best; `None` if no keyframe was found. `drive` has the keyframes that were
    /// looked for.
    pub fn place(&self, drive: &G2o) -> Result<Option<PlacedDrive>, EstimationError> {
        let Some(map_from_drive) = self.most_agreed(drive) else {
            return Ok(None);
        };
        let placed = drive.poses.iter().map(|pose| map_from_drive * pose);
        // The first pose of a graph stays where it is: it is the map's.
        let poses: Vec<Pose> = std::iter::once(Pose::identity()).chain(placed).collect();
        let mut graph = self.graph(drive, &poses)?;
        graph.start_from(&poses)?;
        graph.solve()?;
        let agreeing: HashSet<usize> = graph
            .loops()
            .filter(|it| it.from == 0 && it.chi_square <= CHI_SQUARE_99_9)
            .map(|it| it.to - 1)
            .collect();
        let agreeing = self
            .found
            .iter()
            .filter(|it| agreeing.contains(&it.keyframe));
        Ok(Some(PlacedDrive {
            poses: graph.poses()[1..].to_vec(),
            agreeing: agreeing.copied().collect(),
        }))
    }

    /// Returns the pose of the drive in the map by the fix that agrees best with the others: the
    /// least median of their distances. A wrong one would draw all others away. `None` without a
    /// fix.
    fn most_agreed(&self, drive: &G2o) -> Option<Pose> {
        let found = &self.found;
        let step = found.len().div_ceil(STARTS).max(1);
        let starts = found.iter().step_by(step);
        let starts = starts.map(|it| it.fix.pose.motion * drive.poses[it.keyframe].inverse());
        let median = |start: &Pose| {
            let distance = |it: &FoundKeyframe| {
                let placed = start * drive.poses[it.keyframe];
                (placed.translation.vector - it.fix.pose.motion.translation.vector).norm()
            };
            let mut distances: Vec<f64> = found.iter().map(distance).collect();
            let middle = distances.len() / 2;
            *distances.select_nth_unstable_by(middle, f64::total_cmp).1
        };
        starts
            .map(|start| (median(&start), start))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, start)| start)
    }

    fn graph(&self, drive: &G2o, poses: &[Pose]) -> Result<PoseGraph, EstimationError> {
        let anywhere = UncertainMotion {
            motion: poses[1],
            covariance: Matrix3::from_diagonal(&Vector3::from(ANYWHERE.map(|sigma| sigma * sigma))),
        };
        let mut graph = PoseGraph::new(poses[0], GraphOptions::default());
        graph.apply(&Constraint::odometry(0, anywhere))?;
        let between = |from: u64, keyframe: usize| Kind::Loop {
            group: Some(from << 32 | self.stretches[keyframe]),
        };
        for constraint in &drive.constraints {
            let &Constraint { from, to, .. } = constraint;
            graph.apply(&Constraint {
                from: from + 1,
                to: to + 1,
                kind: match constraint.kind {
                    Kind::Loop { .. } => between(self.stretches[from], to),
                    kind => kind,
                },
                ..*constraint
            })?;
        }
        for it in &self.found {
            graph.apply(&Constraint {
                from: 0,
                to: it.keyframe + 1,
                motion: it.fix.pose,
                kind: between(OF_MAP, it.keyframe),
            })?;
        }
        Ok(graph)
    }
}

#[cfg(test)]
mod tests {
    use gyre_geometry::pose;

    use super::*;

    fn uncertain(motion: Pose, sigma: f64) -> UncertainMotion {
        UncertainMotion {
            motion,
            covariance: Matrix3::identity() * sigma * sigma,
        }
    }

    #[test]
    fn a_drive_is_bent_to_where_it_was_found_and_no_farther() {
        // Odometry turns by 0.1 degrees a keyframe; the drive goes straight on from (5, 7) at a
        // quarter turn.
        let true_pose = |k: usize| pose(5.0, 7.0 + 2.0 * k as f64, std::f64::consts::FRAC_PI_2);
        let motion = uncertain(pose(2.0, 0.0, 0.1f64.to_radians()), 0.01);
        let mut poses = vec![Pose::identity()];
        for _ in 1..100 {
            poses.push(poses[poses.len() - 1] * motion.motion);
        }
        let drive = G2o {
            constraints: (0..99).map(|k| Constraint::odometry(k, motion)).collect(),
            poses,
        };
        let found_at = |keyframe: usize, motion: Pose| FoundKeyframe {
            keyframe,
            fix: Fix {
                pose: uncertain(motion, 0.02),
                correlation: 0.8,
                margin: 0.3,
                keyframe: 0,
            },
        };
        let right = (10..60).map(|keyframe| found_at(keyframe, true_pose(keyframe)));
        // The first fix is of another place.
        let wrong = found_at(5, pose(-3e3, 2e3, 1.0));
        let search = DriveSearch {
            found: std::iter::once(wrong).chain(right).collect(),
            stretches: (0..100).map(|keyframe| 2 * keyframe / 5).collect(),
        };
        let placed = search.place(&drive).unwrap().unwrap();
        let agreeing: Vec<usize> = placed.agreeing.iter().map(|it| it.keyframe).collect();
        assert_eq!(agreeing, (10..60).collect::<Vec<usize>>());
        let poses = &placed.poses;
        let error_m =
            |k: usize| (poses[k].translation.vector - true_pose(k).translation.vector).norm();
        assert_eq!(poses.len(), 100);
        assert!((10..60).all(|k| error_m(k) < 0.2), "{}", error_m(35));
        assert!(error_m(0) < 1.0, "{}", error_m(0));
        // Beyond, odometry continues from the last place.
        let ahead = poses[59].inv_mul(&poses[60]);
        assert!((ahead.translation.vector - motion.motion.translation.vector).norm() < 0.05);
    }
}
