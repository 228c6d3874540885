//! TUM: `seconds x y z qx qy qz qw`, the scalar last.

use std::io::{self, Write};

use gyre_geometry::{Pose, pose};

use super::{
    LineError, lines, numbers,
    plane::{Matrix, project},
    stamped,
};
use crate::dataset::stamp;
use gyre_radar::trajectory::Trajectory;
use gyre_storage::quoted;

pub(super) fn parse(text: &str) -> Result<Trajectory, LineError> {
    let (stamps, matrices) = stamped(lines(text), |line, row| {
        let seconds = row.split_whitespace().next().unwrap_or_default();
        let stamp = stamp::parse_seconds(seconds).ok_or_else(|| {
            let seconds = quoted(seconds);
            LineError::new(line, format!("time {seconds} is not a number of seconds"))
        })?;
        let [_, x, y, z, qx, qy, qz, qw] = numbers(line, row.split_whitespace())?;
        let norm = qx * qx + qy * qy + qz * qz + qw * qw;
        if norm < 1e-12 {
            return Err(LineError::new(line, "the quaternion is zero"));
        }
        Ok((stamp, matrix([x, y, z], [qx, qy, qz, qw])))
    })?;
    // Direction ahead in the plane: correct for any roll and pitch, and for quaternions that are
    // not exactly normalised.
    let projected = project(&matrices)?.into_iter();
    let poses = projected.map(|[x, y, cos, sin]| pose(x, y, sin.atan2(cos)));
    Ok(Trajectory {
        stamp_ns: Some(stamps),
        poses: poses.collect(),
    })
}

/// Returns the matrix of a position and a quaternion; its rotation has the scale of the quaternion.
fn matrix([x, y, z]: [f64; 3], [qx, qy, qz, qw]: [f64; 4]) -> Matrix {
    let (ww, xx, yy, zz) = (qw * qw, qx * qx, qy * qy, qz * qz);
    [
        ww + xx - yy - zz,
        2.0 * (qx * qy - qw * qz),
        2.0 * (qx * qz + qw * qy),
        x,
        2.0 * (qw * qz + qx * qy),
        ww - xx + yy - zz,
        2.0 * (qy * qz - qw * qx),
        y,
        2.0 * (qx * qz - qw * qy),
        2.0 * (qy * qz + qw * qx),
        ww - xx - yy + zz,
        z,
    ]
}

/// A trajectory without times is `InvalidInput`.
pub fn write_tum(trajectory: &Trajectory, out: &mut impl Write) -> io::Result<()> {
    let stamps = trajectory.stamp_ns.as_ref();
    let missing = "a TUM file requires times, but the trajectory has none";
    let missing = || io::Error::new(io::ErrorKind::InvalidInput, missing);
    let stamps = stamps.ok_or_else(missing)?;
    let mut poses = stamps.iter().zip(&trajectory.poses);
    poses.try_for_each(|(ns, pose)| write_tum_pose(*ns, pose, out))
}

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
