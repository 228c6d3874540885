//! TUM and KITTI: poses in space, in the plane x-y of the world.

use std::io::{self, Write};

use gyre_geometry::{Pose, mirrored, pose};
use gyre_radar::trajectory::Trajectory;
use gyre_storage::quoted;
use nalgebra::{Complex, Matrix3, Translation2, Unit, UnitComplex, Vector3};

use super::{LineError, lines, numbers, stamped};
use crate::dataset::stamp;

/// A row-major 3 x 4 pose of the sensor in the world. Its rotation may have any scale.
type Matrix = [f64; 12];

/// The least mean cosine between the vertical axes of sensor and world.
const MIN_UPRIGHT: f64 = 0.7;
/// No road climbs by more than this share of its length.
const MAX_CLIMB: f64 = 0.3;
/// Altitudes vary by so much where a vehicle stands, m.
const ALTITUDE_NOISE_M: f64 = 10.0;
const UNKNOWN: &str = "the poses are in no known frame: the sensor does not stay upright with x forward and z up (or down); turn the poses of a camera \
     so that z is up";
/// A first pose that is nearer to the identity than this, m and in each element of the rotation, is
/// the world.
const NEAR_IDENTITY: f64 = 0.1;

/// Parses TUM: `seconds x y z qx qy qz qw`, the scalar last.
pub(super) fn tum(text: &str) -> Result<Trajectory, LineError> {
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
    Ok(Trajectory::timed(stamps, poses.collect()))
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

/// Parses KITTI: twelve numbers per line, a row-major 3 x 4 pose, after an optional index. Also
/// Boreas odometry files, whose 13 columns are a time and the inverse of the pose.
pub(super) fn kitti(text: &str) -> Result<Trajectory, LineError> {
    let first = lines(text).next();
    if first.is_some_and(|(_, row)| leading_stamp(row).is_some()) {
        return boreas_odometry(text);
    }
    let mut matrices = Vec::new();
    for (line, row) in lines(text) {
        let leading = usize::from(row.split_whitespace().count() == 13);
        matrices.push(numbers::<12>(line, row.split_whitespace().skip(leading))?);
    }
    let poses = project(&matrices)?.into_iter().map(planar);
    Ok(Trajectory::untimed(poses.collect()))
}

/// Parses a file of Boreas. Its poses have roll and pitch: they are inverted in space, and
/// projected to the plane at last.
fn boreas_odometry(text: &str) -> Result<Trajectory, LineError> {
    let (stamps, matrices) = stamped(lines(text), |line, row| {
        let missing = "the first column is not a time, as in the first line";
        let stamp = leading_stamp(row).ok_or_else(|| LineError::new(line, missing))?;
        let matrix = numbers::<12>(line, row.split_whitespace().skip(1))?;
        Ok((stamp, inverse(&matrix)))
    })?;
    let poses = project(&matrices)?.into_iter().map(planar);
    // Boreas' sensors have y to the right where the world is their first frame, not a map.
    let poses = match matrices.first().is_some_and(is_near_identity) {
        true => poses.map(|pose| mirrored(&pose)).collect(),
        false => poses.collect(),
    };
    Ok(Trajectory::timed(stamps, poses))
}

fn inverse(m: &Matrix) -> Matrix {
    let back = Matrix3::new(m[0], m[4], m[8], m[1], m[5], m[9], m[2], m[6], m[10]);
    let t = back * Vector3::new(-m[3], -m[7], -m[11]);
    [
        m[0], m[4], m[8], t.x, m[1], m[5], m[9], t.y, m[2], m[6], m[10], t.z,
    ]
}

fn is_near_identity(m: &Matrix) -> bool {
    let identity = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let mut pairs = m.iter().zip(identity);
    pairs.all(|(a, b)| (a - b).abs() < NEAR_IDENTITY)
}

fn leading_stamp(row: &str) -> Option<i64> {
    let mut words = row.split_whitespace();
    let first = words.next()?.parse::<i64>().ok()?;
    stamp::to_ns(first).filter(|_| words.count() == 12)
}

/// Cosine and sine are taken without normalisation if their norm is near 1: published KITTI results
/// come from matrices rounded to six decimals, and normalising them changes the fifth decimal of
/// the result.
fn planar([x, y, cos, sin]: [f64; 4]) -> Pose {
    let rotation = match (cos.hypot(sin) - 1.0).abs() < 1e-4 {
        true => Unit::new_unchecked(Complex::new(cos, sin)),
        false => UnitComplex::new(sin.atan2(cos)),
    };
    Pose::from_parts(Translation2::new(x, y), rotation)
}

/// Returns x and y of each pose, and its direction ahead as cosine and sine, times the scale of the
/// rotation.
fn project(poses: &[Matrix]) -> Result<Vec<[f64; 4]>, LineError> {
    let cosine = |m: &Matrix| m[10].abs() / m[2].hypot(m[6]).hypot(m[10]).max(f64::MIN_POSITIVE);
    let upright = poses.iter().map(cosine).sum::<f64>() / poses.len() as f64;
    match upright > MIN_UPRIGHT && !moves_along_z(poses) {
        true => Ok(poses.iter().map(|m| [m[3], m[7], m[0], m[4]]).collect()),
        false => Err(LineError::new(1, UNKNOWN)),
    }
}

/// Returns whether poses are in the axes of a camera (z forward, y down): on a straight road a
/// camera stays upright about z too.
fn moves_along_z(poses: &[Matrix]) -> bool {
    let [x, y, z] = [3, 7, 11].map(|axis| {
        let at = || poses.iter().map(|m| m[axis]);
        at().fold(f64::MIN, f64::max) - at().fold(f64::MAX, f64::min)
    });
    z > ALTITUDE_NOISE_M && z > MAX_CLIMB * (x + y + z) && y < 0.5 * z
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

/// Writes KITTI poses in the plane (z = 0).
pub fn write_kitti(trajectory: &Trajectory, out: &mut impl Write) -> io::Result<()> {
    for pose in &trajectory.poses {
        let (sin, cos) = pose.rotation.angle().sin_cos();
        let (x, y, minus) = (pose.translation.x, pose.translation.y, -sin);
        writeln!(
            out,
            "{cos:.12} {minus:.12} 0 {x:.6} {sin:.12} {cos:.12} 0 {y:.6} 0 0 1 0"
        )?;
    }
    Ok(())
}
