//! TUM: `seconds x y z qx qy qz qw`, the scalar last.

use std::io::{self, Write};

use gyre_geometry::{Pose, pose};

use super::{LineError, check_increasing, lines, numbers};
use crate::dataset::stamp;
use crate::quoted::quoted;
use crate::trajectory::Trajectory;

pub(super) fn parse(text: &str) -> Result<Trajectory, LineError> {
    let (mut stamps, mut poses) = (Vec::new(), Vec::new());
    for (line, row) in lines(text) {
        let seconds = row.split_whitespace().next().unwrap_or_default();
        let stamp = stamp::parse_seconds(seconds).ok_or_else(|| LineError {
            line,
            reason: format!("time {} is not a number of seconds", quoted(seconds)),
        })?;
        check_increasing(line, &stamps, stamp)?;
        let [_, x, y, _, qx, qy, qz, qw] = numbers(line, row.split_whitespace())?;
        let norm = qx * qx + qy * qy + qz * qz + qw * qw;
        if norm < 1e-12 {
            return Err(LineError {
                line,
                reason: "the quaternion is zero".to_owned(),
            });
        }
        stamps.push(stamp);
        // Direction of the x axis in the plane: correct for any roll and pitch, and for quaternions
        // that are not exactly normalised.
        let yaw = (2.0 * (qw * qz + qx * qy)).atan2(qw * qw + qx * qx - qy * qy - qz * qz);
        poses.push(pose(x, y, yaw));
    }
    Ok(Trajectory {
        stamp_ns: Some(stamps),
        poses,
    })
}

/// Writes TUM poses with stamps in ns.
///
/// # Errors
/// `InvalidInput` for a trajectory without times; errors of `out`.
pub fn write_tum(trajectory: &Trajectory, out: &mut impl Write) -> io::Result<()> {
    let stamps = trajectory.stamp_ns.as_ref();
    let stamps = stamps.ok_or_else(|| {
        io::Error::new(
            io::ErrorKind::InvalidInput,
            "a TUM file requires times, but the trajectory has none",
        )
    })?;
    let mut poses = stamps.iter().zip(&trajectory.poses);
    poses.try_for_each(|(ns, pose)| write_tum_pose(*ns, pose, out))
}

/// Writes a TUM pose with its stamp in ns.
///
/// # Errors
/// Errors of `out`.
pub fn write_tum_pose(ns: i64, pose: &Pose, out: &mut impl Write) -> io::Result<()> {
    let (sin, cos) = (pose.rotation.angle() / 2.0).sin_cos();
    let (sign, size) = (if ns < 0 { "-" } else { "" }, ns.unsigned_abs());
    let (seconds, nanoseconds) = (size / 1_000_000_000, size % 1_000_000_000);
    let (x, y) = (pose.translation.x, pose.translation.y);
    writeln!(
        out,
        "{sign}{seconds}.{nanoseconds:09} {x:.6} {y:.6} 0 0 0 {sin:.12} {cos:.12}"
    )
}
