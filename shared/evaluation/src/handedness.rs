//! Axes that run the other way: frames with y to the right, headings that grow clockwise.
//!
//! Radar data sets and odometries disagree on handedness. A frame with y to the right has a clockwise yaw, so both
//! change sign together; some files get only one of the two wrong. The estimate is held against the truth with each
//! sign, and what is found is undone in the estimate and said.

use std::fmt;

use gyre_geometry::Pose;
use serde::Serialize;

use crate::{MatchedPoses, ate::aligned_rmse_m};

/// What had to change sign in the estimate to agree with the truth.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Axes {
    /// y was negated: the path is mirrored against the truth's.
    pub y_negated: bool,
    /// yaw was negated: heading grows the other way.
    pub heading_negated: bool,
    /// Set where only one of the two was negated: then one of the trajectories contradicts itself.
    pub heading_fault: Option<HeadingFault>,
    /// The truth's heading never changes although the estimate turns: it has positions only.
    pub truth_lacks_heading: bool,
}

/// Whose heading runs against the turns of its own path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum HeadingFault {
    /// The estimate's.
    Estimate,
    /// The truth's.
    Truth,
    /// The paths do not tell.
    Unclear,
}

/// Whether one sign fits clearly better than the other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum AxisSense {
    /// As given.
    AsGiven,
    /// Negated.
    Negated,
    /// Neither: a straight path looks the same in a mirror.
    Open,
}

/// One sign wins when it leaves less than this share of the other's misfit...
const CLEAR_SHARE: f64 = 0.5;
/// ...and the other's misfit is more than rounding: positions, m.
const LEAST_MISFIT_M: f64 = 0.01;
/// The same for headings, rad.
const LEAST_MISFIT_RAD: f64 = 1e-3;
/// A heading that moves by less than this is none, rad (TUM files carry nine decimals).
const CONSTANT_RAD: f64 = 1e-6;
/// An estimate that turns by less than this does not show that the truth lacks a heading, rad.
const LEAST_TURN_RAD: f64 = 0.1;
/// Steps over which a path's own turns are measured: long against the noise of positions, m.
const COURSE_STEP_M: f64 = 5.0;

/// Finds the signs in which the estimate fits the truth, and returns it with those signs.
///
/// Positions and headings vote: where one of them is clear and the other open, the clear one decides for both.
/// A wrong-handed sensor frame always shows, and a poor estimate is not mirrored because its mirror image happens to
/// lie a little nearer.
pub fn resolve_axes(matched: MatchedPoses) -> (MatchedPoses, Axes) {
    let (estimate_yaw, truth_yaw) = (
        unwrapped_yaw(matched.estimate()),
        unwrapped_yaw(matched.truth()),
    );
    let given_m = aligned_rmse_m(matched.estimate(), matched.truth());
    let mirror_image: Vec<_> = matched
        .estimate()
        .iter()
        .map(|p| negate(p, true, true))
        .collect();
    let mirrored_m = aligned_rmse_m(&mirror_image, matched.truth());
    let y = sense(given_m, mirrored_m, LEAST_MISFIT_M);
    let heading = sense(
        heading_misfit(&estimate_yaw, &truth_yaw, 1.0),
        heading_misfit(&estimate_yaw, &truth_yaw, -1.0),
        LEAST_MISFIT_RAD,
    );
    let (y_negated, heading_negated) = decide(y, heading, mirrored_m < given_m + LEAST_MISFIT_M);
    let axes = Axes {
        y_negated,
        heading_negated,
        heading_fault: (y_negated != heading_negated).then(|| heading_fault(&matched)),
        truth_lacks_heading: range(&truth_yaw) < CONSTANT_RAD
            && range(&estimate_yaw) > LEAST_TURN_RAD,
    };
    (
        matched.map_estimate(|p| negate(p, y_negated, heading_negated)),
        axes,
    )
}

/// Whether to negate y and heading, from the votes of both.
fn decide(y: AxisSense, heading: AxisSense, mirror_no_worse: bool) -> (bool, bool) {
    use AxisSense::{AsGiven, Negated, Open};
    match (y, heading) {
        (Open, Open | AsGiven) => (false, false),
        (Open, Negated) => (mirror_no_worse, true),
        (y, Open) => (y == Negated, y == Negated),
        (y, heading) => (y == Negated, heading == Negated),
    }
}

fn sense(given: f64, negated: f64, least: f64) -> AxisSense {
    if negated < CLEAR_SHARE * given && given > least {
        AxisSense::Negated
    } else if given < CLEAR_SHARE * negated && negated > least {
        AxisSense::AsGiven
    } else {
        AxisSense::Open
    }
}

fn negate(pose: &Pose, y: bool, heading: bool) -> Pose {
    let mut changed = *pose;
    if y {
        changed.translation.y = -changed.translation.y;
    }
    if heading {
        changed.rotation = changed.rotation.inverse();
    }
    changed
}

/// Yaw of each pose without jumps of a full turn, rad.
fn unwrapped_yaw(poses: &[Pose]) -> Vec<f64> {
    let mut yaw = poses.first().map_or(0.0, |p| p.rotation.angle());
    let turns = poses
        .windows(2)
        .map(|w| w[0].rotation.angle_to(&w[1].rotation));
    std::iter::once(0.0)
        .chain(turns)
        .map(|turn| {
            yaw += turn;
            yaw
        })
        .take(poses.len())
        .collect()
}

fn range(values: &[f64]) -> f64 {
    let (low, high) = values
        .iter()
        .fold((f64::MAX, f64::MIN), |(l, h), &v| (l.min(v), h.max(v)));
    high - low
}

/// Spread (RMS about its mean, rad) of the difference between `sign` times the estimated and the true yaw.
fn heading_misfit(estimate: &[f64], truth: &[f64], sign: f64) -> f64 {
    let n = truth.len() as f64;
    let difference = || estimate.iter().zip(truth).map(|(e, t)| sign * e - t);
    let mean = difference().sum::<f64>() / n;
    (difference().map(|d| (d - mean).powi(2)).sum::<f64>() / n).sqrt()
}

fn heading_fault(matched: &MatchedPoses) -> HeadingFault {
    let (estimate, truth) = (
        turns_with_path(matched.estimate()),
        turns_with_path(matched.truth()),
    );
    match (estimate < 0.0, truth < 0.0) {
        (true, false) => HeadingFault::Estimate,
        (false, true) => HeadingFault::Truth,
        _ => HeadingFault::Unclear,
    }
}

/// Sum over the path of heading change times course change: negative where the heading turns against its own path.
fn turns_with_path(poses: &[Pose]) -> f64 {
    let mut kept: Vec<&Pose> = Vec::new();
    for pose in poses {
        if kept.last().is_none_or(|k| {
            (pose.translation.vector - k.translation.vector).norm() >= COURSE_STEP_M
        }) {
            kept.push(pose);
        }
    }
    let step = |from: &Pose, to: &Pose| to.translation.vector - from.translation.vector;
    kept.windows(3)
        .map(|w| {
            let (before, after) = (step(w[0], w[1]), step(w[1], w[2]));
            let course = before.perp(&after).atan2(before.dot(&after));
            course * 0.5 * w[0].rotation.angle_to(&w[2].rotation)
        })
        .sum()
}

impl fmt::Display for Axes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match (self.y_negated, self.heading_negated) {
            (false, false) => "as given",
            (true, true) => {
                "the estimate is mirrored against the truth: its y and yaw were negated"
            }
            (true, false) => {
                "the estimate's path, but not its heading, is mirrored: its y was negated"
            }
            (false, true) => "the estimate's heading runs the other way: its yaw was negated",
        })?;
        f.write_str(match self.heading_fault {
            None => "",
            Some(HeadingFault::Estimate) => " (its heading turns against its own path)",
            Some(HeadingFault::Truth) => {
                " (it is the truth's heading that turns against its own path)"
            }
            Some(HeadingFault::Unclear) => " (whose heading is wrong is unclear)",
        })?;
        if self.truth_lacks_heading {
            f.write_str("; the truth has no heading")
        } else {
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use gyre_geometry::pose;

    /// A drive with bends to both sides, more to the left, that ends elsewhere.
    fn drive() -> Vec<Pose> {
        let mut here = pose(3.0, -2.0, 0.4);
        (0..300)
            .map(|k| {
                let motion = pose(1.0, 0.0, 0.03 * (0.04 * f64::from(k)).sin() + 0.004);
                here *= motion;
                here
            })
            .collect()
    }

    fn resolve(estimate: Vec<Pose>, truth: Vec<Pose>) -> Axes {
        resolve_axes(MatchedPoses::new(estimate, truth).unwrap()).1
    }

    fn with(poses: Vec<Pose>, y: bool, heading: bool) -> Vec<Pose> {
        poses.iter().map(|p| negate(p, y, heading)).collect()
    }

    #[test]
    fn each_combination_of_signs_is_found_and_its_culprit_named() {
        for (y, heading) in [(false, false), (true, true), (true, false), (false, true)] {
            let fault = |side| (y != heading).then_some(side);
            let estimate = resolve(with(drive(), y, heading), drive());
            let expected = Axes {
                y_negated: y,
                heading_negated: heading,
                ..Axes::default()
            };
            assert_eq!(
                estimate,
                Axes {
                    heading_fault: fault(HeadingFault::Estimate),
                    ..expected
                }
            );
            let truth = resolve(drive(), with(drive(), y, heading));
            assert_eq!(
                truth,
                Axes {
                    heading_fault: fault(HeadingFault::Truth),
                    ..expected
                }
            );
        }
    }

    #[test]
    fn the_estimate_comes_back_in_the_signs_of_the_truth() {
        let matched = MatchedPoses::new(with(drive(), true, true), drive()).unwrap();
        let (resolved, _) = resolve_axes(matched);
        assert_eq!(resolved.estimate(), drive());
    }

    #[test]
    fn a_straight_path_is_left_as_given() {
        let line: Vec<_> = (0..100).map(|k| pose(f64::from(k), 0.0, 0.0)).collect();
        assert_eq!(resolve(line.clone(), line), Axes::default());
    }

    #[test]
    fn a_poor_estimate_is_not_mirrored_for_a_little_gain() {
        assert_eq!(
            decide(sense(20.0, 15.0, 0.01), AxisSense::AsGiven, true),
            (false, false)
        );
        assert_eq!(
            decide(sense(20.0, 15.0, 0.01), AxisSense::Negated, true),
            (true, true)
        );
    }

    #[test]
    fn a_truth_of_positions_alone_is_recognised() {
        let positions = drive()
            .iter()
            .map(|p| pose(p.translation.x, p.translation.y, 0.0))
            .collect();
        let axes = resolve(with(drive(), true, true), positions);
        assert!(axes.truth_lacks_heading && axes.y_negated && axes.heading_negated);
        assert_eq!(axes.heading_fault, None);
    }
}
