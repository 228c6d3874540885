//! A drive that somebody drove: trajectories from files.

use std::path::Path;

use gyre_geometry::Pose;
use gyre_radar::read_trajectory;
use nalgebra::Point2;

use super::spline_path::SplinePath;
use crate::error::SimulatorError;

/// No vehicle is faster, metres a second.
const FASTEST_MPS: f64 = 90.0;
/// Nor stands without a pose for longer, seconds.
const LONGEST_PAUSE_S: f64 = 3600.0;

/// What to take of a file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Excerpt {
    /// Where to begin, seconds after the file's first pose.
    pub from_s: f64,
    /// How much at most, seconds.
    pub for_s: f64,
    /// Poses a second in a file without times.
    pub rate_hz: f64,
}

impl Default for Excerpt {
    fn default() -> Self {
        Self {
            from_s: 0.0,
            for_s: f64::INFINITY,
            rate_hz: 4.0,
        }
    }
}

/// The drive of a file of any form that [`gyre_radar::read_trajectory`] knows, in the frame of the excerpt's first pose.
///
/// It passes within 5 cm of 95 % of a real drive's poses and within 10 cm of 99 % (what is left is their noise), and stands still before its start and after its end.
pub fn read(path: &Path, excerpt: Excerpt) -> Result<SplinePath, SimulatorError> {
    let poses = timed(path, excerpt.rate_hz)?;
    let refuse = |reason: String| SimulatorError::Drive {
        path: path.to_owned(),
        reason,
    };
    let end_s = excerpt.from_s + excerpt.for_s;
    let within: Vec<_> = poses
        .iter()
        .filter(|(s, _)| (excerpt.from_s..=end_s).contains(s))
        .collect();
    let [(start_s, origin), _, ..] = within[..] else {
        let last_s = poses.last().map_or(0.0, |(s, _)| *s);
        return Err(refuse(format!(
            "it has less than two poses from {} s on; it lasts {last_s:.1} s",
            excerpt.from_s
        )));
    };
    check_steps(&within).map_err(refuse)?;
    let into_world = origin.inverse();
    let moved: Vec<_> = within
        .iter()
        .map(|(s, pose)| (s - start_s, into_world * pose))
        .collect();
    let ahead = share_ahead(&moved);
    if ahead < 0.5 {
        let share = 100.0 * ahead;
        return Err(refuse(format!(
            "only {share:.0} % of its way lead ahead (x forward, y left): is it another frame?"
        )));
    }
    Ok(SplinePath::measured(&moved))
}

/// Refuses what no vehicle does: jumps, and pauses of many hours.
fn check_steps(poses: &[&(f64, Pose)]) -> Result<(), String> {
    for pair in poses.windows(2) {
        let ((from_s, from), (to_s, to)) = (pair[0], pair[1]);
        let (seconds, metres) = (
            to_s - from_s,
            (to.translation.vector - from.translation.vector).norm(),
        );
        if metres > FASTEST_MPS * seconds + 1.0 {
            return Err(format!(
                "it jumps by {metres:.1} m within {seconds:.3} s, {from_s:.3} s after its start"
            ));
        }
        if seconds > LONGEST_PAUSE_S {
            return Err(format!(
                "it pauses for {seconds:.0} s, {from_s:.3} s after its start"
            ));
        }
    }
    Ok(())
}

/// All poses with their seconds after the first; of poses with the same stamp the first.
fn timed(path: &Path, rate_hz: f64) -> Result<Vec<(f64, Pose)>, SimulatorError> {
    let read = read_trajectory(path)?;
    let seconds = |index: usize| match &read.stamp_ns {
        Some(stamps) => (stamps[index] - stamps[0]) as f64 * 1e-9,
        None => index as f64 / rate_hz,
    };
    let mut poses: Vec<(f64, Pose)> = read
        .poses
        .iter()
        .enumerate()
        .map(|(index, pose)| (seconds(index), *pose))
        .collect();
    poses.dedup_by(|later, kept| later.0 <= kept.0);
    Ok(poses)
}

/// Share of a way that leads along x of the body, within 45 degrees; 1 where there is no way to speak of.
fn share_ahead(poses: &[(f64, Pose)]) -> f64 {
    let (mut ahead_m, mut all_m) = (0.0, 0.0);
    let mut from = poses[0].1;
    for (_, pose) in poses {
        let step = from.inverse_transform_point(&Point2::from(pose.translation.vector));
        let length_m = step.coords.norm();
        if length_m < 0.5 {
            continue;
        }
        all_m += length_m;
        ahead_m += if step.x > step.y.abs() { length_m } else { 0.0 };
        from = *pose;
    }
    if all_m > 5.0 { ahead_m / all_m } else { 1.0 }
}
