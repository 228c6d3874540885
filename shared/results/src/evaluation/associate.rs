//! Association: the ground-truth pose of each estimated pose, by time or by index.

use gyre_geometry::{Pose, interpolate};
use gyre_radar::Trajectory;
use serde::Serialize;

use crate::evaluation::{
    EvaluationError, MatchedPoses,
    error::{ESTIMATE, TRUTH},
    gaps::max_gap_ns,
    matched::require_poses,
};

/// The widest gap between two stamps of the ground truth that is interpolated across, ns; wider if
/// its own steps are: see [`max_gap_ns`].
const LEAST_GAP_NS: i64 = 1_000_000_000;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(tag = "by", rename_all = "snake_case")]
pub enum Coverage {
    Time {
        matched: usize,
        /// Estimated poses before the first or after the last stamp of the ground truth: left out.
        outside_span: usize,
        /// Estimated poses in gaps of the ground truth wider than allowed: left out.
        in_gaps: usize,
        max_gap_ns: i64,
    },
    Index {
        matched: usize,
        /// Estimated poses beyond the end of the ground truth: left out.
        estimate_surplus: usize,
        /// Ground-truth poses beyond the end of the estimate: left out.
        truth_surplus: usize,
    },
}

/// Interpolates the ground truth at the stamps of the estimate: positions linearly, yaw the shorter
/// way round. If one of them has no stamps, pose `k` belongs to pose `k`, and the longer list is
/// cut to the shorter.
pub fn associate(
    estimate: &Trajectory,
    truth: &Trajectory,
) -> Result<(MatchedPoses, Coverage), EvaluationError> {
    require_poses(ESTIMATE, &estimate.poses)?;
    require_poses(TRUTH, &truth.poses)?;
    let (matched, coverage) = match estimate.stamps().is_empty() || truth.stamps().is_empty() {
        true => by_index(&estimate.poses, &truth.poses),
        false => by_time(estimate, truth)?,
    };
    match matched.len() {
        count @ 0..2 => Err(EvaluationError(format!(
            "{count} of {} estimated poses could be associated with the {} poses of the ground truth; at least 2 are needed",
            estimate.poses.len(),
            truth.poses.len()
        ))),
        _ => Ok((matched, coverage)),
    }
}

fn by_index(estimate: &[Pose], truth: &[Pose]) -> (MatchedPoses, Coverage) {
    let matched = estimate.len().min(truth.len());
    let coverage = Coverage::Index {
        matched,
        estimate_surplus: estimate.len() - matched,
        truth_surplus: truth.len() - matched,
    };
    let [estimate, truth] = [estimate, truth].map(|poses| poses[..matched].to_vec());
    (MatchedPoses::new(estimate, truth), coverage)
}

fn by_time(
    estimate: &Trajectory,
    truth: &Trajectory,
) -> Result<(MatchedPoses, Coverage), EvaluationError> {
    require_stamps(ESTIMATE, estimate)?;
    require_stamps(TRUTH, truth)?;
    let max_gap_ns = max_gap_ns(truth.stamps(), LEAST_GAP_NS);
    let (mut kept, mut true_poses) = (Vec::new(), Vec::new());
    let (mut outside_span, mut in_gaps) = (0, 0);
    for (&stamp_ns, pose) in estimate.stamps().iter().zip(&estimate.poses) {
        match pose_at(truth, stamp_ns, max_gap_ns) {
            At::Pose(true_pose) => {
                kept.push(*pose);
                true_poses.push(true_pose);
            }
            At::Outside => outside_span += 1,
            At::Gap => in_gaps += 1,
        }
    }
    let matched = kept.len();
    if matched == 0 && in_gaps == 0 {
        let span_s = |stamps_ns: &[i64]| {
            let ends = [stamps_ns[0], stamps_ns[stamps_ns.len() - 1]];
            let [first_s, last_s] = ends.map(|ns| ns as f64 * 1e-9);
            format!("{first_s:.3} s to {last_s:.3} s")
        };
        let (estimate, truth) = (span_s(estimate.stamps()), span_s(truth.stamps()));
        return Err(EvaluationError(format!(
            "the trajectories do not overlap in time: estimate {estimate}, ground truth {truth} (same clock, same unit?)"
        )));
    }
    let coverage = Coverage::Time {
        matched,
        outside_span,
        in_gaps,
        max_gap_ns,
    };
    Ok((MatchedPoses::new(kept, true_poses), coverage))
}

/// Refuses a wrong count of stamps, and stamps that decrease.
pub(crate) fn require_stamps(side: &str, trajectory: &Trajectory) -> Result<(), EvaluationError> {
    let (stamps, poses) = (trajectory.stamps(), trajectory.poses.len());
    if stamps.len() != poses {
        let stamps = stamps.len();
        return Err(EvaluationError(format!(
            "the {side} has {poses} poses but {stamps} stamps"
        )));
    }
    if let Some(k) = stamps.windows(2).position(|w| w[1] < w[0]) {
        let (before, later, k) = (stamps[k], stamps[k + 1], k + 1);
        return Err(EvaluationError(format!(
            "the stamps of the {side} decrease at pose {k}: {later} ns after {before} ns"
        )));
    }
    Ok(())
}

pub(crate) enum At {
    Pose(Pose),
    Outside,
    Gap,
}

/// Files have stamps in microseconds: a stamp that lies this close to an end of a trajectory lies
/// on it.
const ROUNDING_NS: u64 = 1_000;

/// Returns the poses at the multiples of `period_ns`, interpolated, but not in gaps.
pub fn resampled(trajectory: &Trajectory, period_ns: i64) -> Trajectory {
    let max_gap_ns = max_gap_ns(trajectory.stamps(), LEAST_GAP_NS);
    let (first, last) = trajectory.span_ns().unwrap_or_default();
    let steps = first.div_euclid(period_ns)..=last.div_euclid(period_ns);
    let at = |stamp_ns| match pose_at(trajectory, stamp_ns, max_gap_ns) {
        At::Pose(pose) => Some((stamp_ns, pose)),
        At::Outside | At::Gap => None,
    };
    let (stamps, poses) = steps.filter_map(|step| at(step * period_ns)).unzip();
    Trajectory::timed(stamps, poses)
}

/// Returns the pose at `stamp_ns`. A stamp that the trajectory has itself is never in a gap.
pub(crate) fn pose_at(trajectory: &Trajectory, stamp_ns: i64, max_gap_ns: i64) -> At {
    let stamps_ns = trajectory.stamps();
    let ends = [stamps_ns.first(), stamps_ns.last()];
    let is_end = |end: &&i64| stamp_ns.abs_diff(**end) <= ROUNDING_NS;
    let stamp_ns = *ends.into_iter().flatten().find(is_end).unwrap_or(&stamp_ns);
    let after = stamps_ns.partition_point(|&t| t <= stamp_ns);
    let Some(before) = after.checked_sub(1) else {
        return At::Outside;
    };
    if stamps_ns[before] == stamp_ns {
        return At::Pose(trajectory.poses[before]);
    }
    let Some(&after_ns) = stamps_ns.get(after) else {
        return At::Outside;
    };
    // i128: any two stamps may lie further apart than an i64 can hold.
    let since = |t: i64| i128::from(t) - i128::from(stamps_ns[before]);
    if since(after_ns) > i128::from(max_gap_ns) {
        return At::Gap;
    }
    let share = since(stamp_ns) as f64 / since(after_ns) as f64;
    let [before, after] = [before, after].map(|at| &trajectory.poses[at]);
    At::Pose(interpolate(before, after, share))
}

#[cfg(test)]
mod tests {
    use super::*;
    use gyre_geometry::pose;
    use std::f64::consts::PI;

    const SECOND: i64 = 1_000_000_000;

    fn line(n: usize) -> Vec<Pose> {
        (0..n).map(|k| pose(k as f64, 0.0, 0.0)).collect()
    }

    fn timed(stamps_ns: &[i64], poses: &[Pose]) -> Trajectory {
        Trajectory::timed(stamps_ns.to_vec(), poses.to_vec())
    }

    fn seconds(s: &[f64]) -> Vec<i64> {
        s.iter().map(|s| (s * SECOND as f64) as i64).collect()
    }

    fn by_time(
        estimate_ns: &[i64],
        truth_ns: &[i64],
    ) -> Result<(MatchedPoses, Coverage), EvaluationError> {
        let line = |stamps_ns: &[i64]| timed(stamps_ns, &line(stamps_ns.len()));
        associate(&line(estimate_ns), &line(truth_ns))
    }

    #[test]
    fn the_ground_truth_is_interpolated_where_the_yaw_wraps() {
        let truth = [pose(0.0, 0.0, PI - 0.1), pose(4.0, 2.0, -PI + 0.3)];
        let (matched, _) = associate(
            &timed(&seconds(&[10.0, 10.25, 11.0]), &line(3)),
            &timed(&seconds(&[10.0, 11.0]), &truth),
        )
        .unwrap();
        let between = matched.truth()[1];
        assert!((between.translation.vector - nalgebra::Vector2::new(1.0, 0.5)).norm() < 1e-12);
        assert!((between.rotation.angle() - PI).abs() < 1e-9);
        assert_eq!(matched.truth()[2], truth[1]);
    }

    #[test]
    fn poses_outside_the_span_and_in_gaps_are_left_out_and_counted() {
        let estimate = seconds(&[-0.5, 0.0, 0.5, 1.0, 2.5, 4.0, 5.1]);
        let (matched, coverage) = by_time(&estimate, &seconds(&[0.0, 1.0, 4.0, 5.0])).unwrap();
        let expected = Coverage::Time {
            matched: 4,
            outside_span: 2,
            in_gaps: 1,
            max_gap_ns: 3 * SECOND / 2,
        };
        assert_eq!(coverage, expected);
        let used: Vec<f64> = matched.estimate().iter().map(|p| p.translation.x).collect();
        assert_eq!(used, [1.0, 2.0, 3.0, 5.0]);
    }

    #[test]
    fn poses_between_scans_are_interpolated_but_not_in_gaps() {
        let scans = timed(&seconds(&[10.05, 10.3, 10.55, 12.05, 12.25]), &line(5));
        let at_10_hz = resampled(&scans, SECOND / 10);
        let expected = seconds(&[10.1, 10.2, 10.3, 10.4, 10.5, 12.1, 12.2]);
        assert_eq!(at_10_hz.stamps(), expected);
        let x = |pose: &Pose| (pose.translation.x * 1e9).round() / 1e9;
        let x: Vec<f64> = at_10_hz.poses.iter().map(x).collect();
        assert_eq!(x, [0.2, 0.6, 1.0, 1.4, 1.8, 3.25, 3.75]);
        assert!(resampled(&Trajectory::default(), 1).is_empty());
    }

    #[test]
    fn slow_steps_rounded_ends_and_the_ends_of_the_clock_leave_nothing_out() {
        let jittering = |k: i64| k * SECOND + 2_000_000 * (k % 3);
        let slow: Vec<i64> = (0..60).map(jittering).collect();
        let fast: Vec<i64> = (0..200).map(|k| k * SECOND / 4).collect();
        let matched = |estimate: &[i64], truth: &[i64]| by_time(estimate, truth).unwrap().0.len();
        assert_eq!(matched(&fast, &slow), fast.len());
        for (estimate, expected) in [([4_500, 7_000, 9_999], 3), ([3_000, 7_000, 9_000], 2)] {
            assert_eq!(matched(&estimate, &[5_000, 9_000]), expected);
        }
        let whole = [i64::MIN, i64::MAX];
        assert_eq!(matched(&[i64::MIN, 0, i64::MAX], &whole), 2);
    }

    #[test]
    fn association_by_index_cuts_the_longer_trajectory_and_counts() {
        let [estimate, truth] = [3, 5].map(|n| timed(&[], &line(n)));
        let (matched, coverage) = associate(&estimate, &truth).unwrap();
        let expected = Coverage::Index {
            matched: 3,
            estimate_surplus: 0,
            truth_surplus: 2,
        };
        assert_eq!((matched.len(), coverage), (3, expected));
    }

    #[test]
    fn trajectories_that_cannot_be_associated_are_refused_with_the_reason() {
        let (two, three) = (seconds(&[1.0, 2.0]), seconds(&[0.0, 1.0, 2.0]));
        let refused = |estimate: &[i64], truth: &[i64]| by_time(estimate, truth).unwrap_err().0;
        let (later, apart) = (seconds(&[2.0, 3.0]), seconds(&[10.0, 12.5]));
        let spans = "1.000 s to 2.000 s, ground truth 10.000 s to 12.500 s";
        for (refused, words) in [
            (refused(&two, &apart), spans),
            (refused(&two, &later), "1 of 2 estimated"),
            (refused(&three, &[0, 7, 5]), "truth decrease at pose 2"),
            (refused(&[], &[]), "0 of 0 estimated"),
        ] {
            assert!(refused.contains(words), "{refused}");
        }
        let (short, empty) = (timed(&two, &line(3)), Trajectory::default());
        let refused = associate(&short, &short).unwrap_err();
        assert!(refused.0.contains("estimate has 3 poses but 2 stamps"));
        assert!(associate(&empty, &empty).is_err());
    }

    #[test]
    fn invalid_poses_are_refused_with_the_reason() {
        let two = line(2);
        let far = |x| vec![two[0], pose(x, 0.0, 0.0)];
        let scaled = |length: f64| {
            let rotation = nalgebra::Unit::new_unchecked(nalgebra::Complex::new(0.0, length));
            vec![Pose::from_parts(Default::default(), rotation); 2]
        };
        let associated = |estimate: &[Pose], truth: &[Pose]| {
            associate(&timed(&[], estimate), &timed(&[], truth))
        };
        assert!(associated(&scaled(1.0 + 1e-6), &two).is_ok());
        for (estimate, truth, words) in [
            (&two, &far(f64::NAN), "pose 1 of the ground truth"),
            (&two, &far(f64::INFINITY), "1 of the ground truth"),
            (&far(-2e9), &two, "pose 1 of the estimate"),
            (&scaled(0.5), &two, "rotation of pose 0 of the estimate"),
        ] {
            let refused = associated(estimate, truth).unwrap_err().0;
            assert!(refused.contains(words), "{refused}");
        }
    }
}
