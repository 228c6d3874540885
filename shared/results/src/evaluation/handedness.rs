//! Handedness: frames with y to the right and clockwise yaw, detected and converted.
//!
//! Radar datasets and odometries disagree on handedness. A frame with y to the right has a
//! clockwise yaw, so both change sign together; some files have only one of the two wrong. The
//! estimate is compared with the ground truth with each sign, and converted to the signs that fit.

use std::fmt;

use gyre_geometry::Pose;
use serde::Serialize;

use crate::evaluation::{MatchedPoses, ate::aligned_rmse_m};

/// The axes that were negated in the estimate to agree with the ground truth.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Axes {
    /// y was negated: the path was mirrored.
    pub y_negated: bool,
    pub heading_negated: bool,
    /// Set if only one of the two was negated: then heading and path of one of the trajectories
    /// contradict each other.
    pub heading_fault: Option<HeadingFault>,
    /// The heading of the ground truth is constant although the estimate turns: it has positions
    /// only.
    pub truth_lacks_heading: bool,
    /// The heading of the estimate is constant although the ground truth turns.
    pub estimate_lacks_heading: bool,
}

impl Axes {
    /// Returns whether the poses of the ground truth are used as they are, with their heading.
    pub fn are_as_given(&self) -> bool {
        !(self.y_negated || self.heading_negated || self.without_heading().is_some())
    }

    /// Returns a clause that names the trajectory without heading; `None` if both have one.
    pub fn without_heading(&self) -> Option<&'static str> {
        match (self.truth_lacks_heading, self.estimate_lacks_heading) {
            (true, _) => Some("the ground truth has no heading"),
            (_, true) => Some(
                "the estimate has no heading (TUM has the scalar of a quaternion last: x y z w)",
            ),
            _ => None,
        }
    }
}

/// The trajectory whose heading has the opposite sense of the turns of its path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum HeadingFault {
    Estimate,
    Truth,
    /// The paths do not show it.
    Unclear,
}

/// A sign is clear if its misfit is below this share of the other's...
const CLEAR_SHARE: f64 = 0.5;
/// ...and the other's misfit is more than rounding: for positions, m.
const MIN_MISFIT_M: f64 = 0.01;
const MIN_MISFIT_RAD: f64 = 1e-3;
/// A heading that varies by less than this is constant, rad (TUM files have nine decimals).
const CONSTANT_RAD: f64 = 1e-6;
/// The least turn of one trajectory that shows that the other has no heading, rad.
const MIN_TURN_RAD: f64 = 0.1;
/// The steps over which the turns of a path are measured, m: long compared with the noise of
/// positions.
const COURSE_STEP_M: f64 = 5.0;

/// Returns the poses with the estimate converted to the signs that fit the ground truth, and those
/// signs.
///
/// Positions and headings vote: if one of them is clear and the other is not, the clear one decides
/// for both. So a left-handed sensor frame is always found, and a poor estimate is not mirrored
/// because its mirror image happens to be a little nearer.
pub fn resolve_axes(matched: MatchedPoses) -> (MatchedPoses, Axes) {
    let (estimate, truth) = (matched.estimate(), matched.truth());
    let (estimate_yaw, truth_yaw) = (unwrapped_yaw(estimate), unwrapped_yaw(truth));
    let given_m = aligned_rmse_m(estimate, truth);
    let mirror_image: Vec<_> = estimate.iter().map(|p| negate(p, true, true)).collect();
    let mirrored_m = aligned_rmse_m(&mirror_image, truth);
    let y = sense(given_m, mirrored_m, MIN_MISFIT_M);
    let [given, negated] = [1.0, -1.0].map(|sign| heading_misfit(&estimate_yaw, &truth_yaw, sign));
    let heading = sense(given, negated, MIN_MISFIT_RAD);
    let (y_negated, heading_negated) = decide(y, heading, mirrored_m < given_m + MIN_MISFIT_M);
    let lacks =
        |yaw: &[f64], other: &[f64]| range(yaw) < CONSTANT_RAD && range(other) > MIN_TURN_RAD;
    let axes = Axes {
        y_negated,
        heading_negated,
        heading_fault: (y_negated != heading_negated).then(|| heading_fault(&matched)),
        truth_lacks_heading: lacks(&truth_yaw, &estimate_yaw),
        estimate_lacks_heading: lacks(&estimate_yaw, &truth_yaw),
    };
    let change = |pose: &Pose| negate(pose, y_negated, heading_negated);
    (matched.map_estimate(change), axes)
}

fn decide(y: Option<bool>, heading: Option<bool>, mirror_no_worse: bool) -> (bool, bool) {
    match (y, heading) {
        (None, None | Some(false)) => (false, false),
        (None, Some(true)) => (mirror_no_worse, true),
        (Some(y), heading) => (y, heading.unwrap_or(y)),
    }
}

/// Returns whether a sign is negated; `None` if neither is clear: a straight path equals its mirror
/// image.
fn sense(given: f64, negated: f64, min_misfit: f64) -> Option<bool> {
    if negated < CLEAR_SHARE * given && given > min_misfit {
        Some(true)
    } else if given < CLEAR_SHARE * negated && negated > min_misfit {
        Some(false)
    } else {
        None
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

/// Returns the yaw of each pose without jumps of a full turn, rad.
fn unwrapped_yaw(poses: &[Pose]) -> Vec<f64> {
    let mut yaw = poses.first().map_or(0.0, |p| p.rotation.angle());
    let turn = |w: &[Pose]| w[0].rotation.angle_to(&w[1].rotation);
    let turns = poses.windows(2).map(turn);
    let add = |turn| {
        yaw += turn;
        yaw
    };
    let unwrapped = std::iter::once(0.0).chain(turns).map(add);
    unwrapped.take(poses.len()).collect()
}

fn range(values: &[f64]) -> f64 {
    let grow = |(low, high): (f64, f64), &it: &f64| (low.min(it), high.max(it));
    let (low, high) = values.iter().fold((f64::MAX, f64::MIN), grow);
    high - low
}

/// Returns the standard deviation of `sign` times the estimated yaw less the true yaw, rad.
fn heading_misfit(estimate: &[f64], truth: &[f64], sign: f64) -> f64 {
    let n = truth.len() as f64;
    let difference = || estimate.iter().zip(truth).map(|(e, t)| sign * e - t);
    let mean = difference().sum::<f64>() / n;
    (difference().map(|d| (d - mean).powi(2)).sum::<f64>() / n).sqrt()
}

fn heading_fault(matched: &MatchedPoses) -> HeadingFault {
    match [matched.estimate(), matched.truth()].map(|poses| turns_with_path(poses) < 0.0) {
        [true, false] => HeadingFault::Estimate,
        [false, true] => HeadingFault::Truth,
        _ => HeadingFault::Unclear,
    }
}

/// Returns the sum of heading change times course change: negative if the heading has the opposite
/// sense of the path.
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
            (true, true) => "the handedness of the estimate differs: its y and yaw were negated",
            (true, false) => {
                "the path of the estimate is mirrored, its heading is not: its y was negated"
            }
            (false, true) => {
                "the heading of the estimate has the opposite sense: its yaw was negated"
            }
        })?;
        f.write_str(match self.heading_fault {
            None => "",
            Some(HeadingFault::Estimate) => " (its heading contradicts its path)",
            Some(HeadingFault::Truth) => " (the heading of the ground truth contradicts its path)",
            Some(HeadingFault::Unclear) => " (it is unclear whose heading is wrong)",
        })?;
        match self.without_heading() {
            Some(clause) => write!(f, "; {clause}"),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
pub mod tests {
    use super::*;
    use gyre_geometry::pose;

    /// A drive with bends to both sides, more to the left.
    pub fn drive() -> Vec<Pose> {
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
        resolve_axes(MatchedPoses::new(estimate, truth)).1
    }

    fn with(poses: Vec<Pose>, y: bool, heading: bool) -> Vec<Pose> {
        poses.iter().map(|p| negate(p, y, heading)).collect()
    }

    #[test]
    fn each_combination_of_signs_is_found_with_the_trajectory_at_fault() {
        for (y, heading) in [(false, false), (true, true), (true, false), (false, true)] {
            let axes = |side| Axes {
                y_negated: y,
                heading_negated: heading,
                heading_fault: (y != heading).then_some(side),
                ..Axes::default()
            };
            let changed = with(drive(), y, heading);
            let matched = MatchedPoses::new(changed.clone(), drive());
            let (resolved, found) = resolve_axes(matched);
            assert_eq!(resolved.estimate(), drive());
            assert_eq!(found, axes(HeadingFault::Estimate));
            assert_eq!(resolve(drive(), changed), axes(HeadingFault::Truth));
        }
    }

    #[test]
    fn a_straight_path_is_left_as_given() {
        let line: Vec<_> = (0..100).map(|k| pose(f64::from(k), 0.0, 0.0)).collect();
        assert_eq!(resolve(line.clone(), line), Axes::default());
    }

    #[test]
    fn a_poor_estimate_is_not_mirrored_for_a_small_gain() {
        let y = sense(20.0, 15.0, 0.01);
        assert_eq!(decide(y, Some(false), true), (false, false));
        assert_eq!(decide(y, Some(true), true), (true, true));
    }

    #[test]
    fn a_ground_truth_without_heading_is_recognised() {
        let position = |p: &Pose| pose(p.translation.x, p.translation.y, 0.0);
        let positions: Vec<Pose> = drive().iter().map(position).collect();
        let axes = resolve(with(drive(), true, true), positions.clone());
        assert!(axes.truth_lacks_heading && axes.y_negated && axes.heading_negated);
        assert_eq!(axes.heading_fault, None);
        let axes = resolve(positions, drive());
        assert!(axes.estimate_lacks_heading && !axes.truth_lacks_heading);
        assert!(axes.to_string().contains("the estimate has no heading"));
    }
}
