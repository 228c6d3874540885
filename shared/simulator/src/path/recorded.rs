use std::path::Path;

use gyre_datasets::{TrajectoryError, parse_trajectory, read_trajectory};
use gyre_geometry::Pose;
use gyre_radar::Trajectory;
use nalgebra::Point2;

use super::spline_path::SplinePath;
use crate::error::SimulatorError;

/// Maximum speed, metres a second.
const FASTEST_MPS: f64 = 90.0;
/// Maximum time between two poses, seconds.
const LONGEST_PAUSE_S: f64 = 3600.0;

/// Returns a path along a trajectory of any format from `from_s` seconds after its first pose on,
/// in the frame of the pose there. It passes within 5 cm of 95 % of a real drive's poses, whose
/// noise is the rest. A file without times has `rate_hz` poses a second.
pub fn read(path: &Path, from_s: f64, rate_hz: f64) -> Result<SplinePath, SimulatorError> {
    let poses = timed(path, rate_hz)?;
    let error = |reason: String| {
        SimulatorError::Refused(format!("cannot drive along {}: {reason}", path.display()))
    };
    let within: Vec<_> = poses.iter().filter(|(s, _)| *s >= from_s).collect();
    let [(start_s, origin), _, ..] = within[..] else {
        let last_s = poses.last().map_or(0.0, |(s, _)| *s);
        return Err(error(format!(
            "it has fewer than two poses after {from_s} s; it lasts {last_s:.1} s"
        )));
    };
    check_steps(&within).map_err(error)?;
    let into_world = origin.inverse();
    let moved: Vec<_> = within
        .iter()
        .map(|(s, pose)| (s - start_s, into_world * pose))
        .collect();
    let forward = share_forward(&moved);
    if forward < 0.5 {
        let share = 100.0 * forward;
        return Err(error(format!(
            "only {share:.0} % of its length is driven forward (x forward, y left): is it in another frame?"
        )));
    }
    Ok(SplinePath::measured(&moved))
}

fn trajectory(path: &Path) -> Result<Trajectory, TrajectoryError> {
    match gyre_storage::shipped::text(path) {
        Some(text) => parse_trajectory(text, path),
        None => read_trajectory(path),
    }
}

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

/// The poses with their seconds after the first; of poses with the same stamp the first.
fn timed(path: &Path, rate_hz: f64) -> Result<Vec<(f64, Pose)>, SimulatorError> {
    let read = trajectory(path)?;
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

/// Share of the distance that is driven along x of the body, within 45 degrees; 1 if it hardly
/// moves.
fn share_forward(poses: &[(f64, Pose)]) -> f64 {
    let (mut forward_m, mut all_m) = (0.0, 0.0);
    let mut from = poses[0].1;
    for (_, pose) in poses {
        let step = from.inverse_transform_point(&Point2::from(pose.translation.vector));
        let length_m = step.coords.norm();
        if length_m < 0.5 {
            continue;
        }
        all_m += length_m;
        forward_m += if step.x > step.y.abs() { length_m } else { 0.0 };
        from = *pose;
    }
    if all_m > 5.0 { forward_m / all_m } else { 1.0 }
}
