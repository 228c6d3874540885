//! KITTI: twelve numbers per line, a row-major 3 x 4 pose, after an optional index. Also Boreas
//! odometry files, whose 13 columns are a time and the inverse of the pose.

use std::io::{self, Write};

use gyre_geometry::{Pose, mirrored};
use nalgebra::{Complex, Matrix3, Translation2, Unit, UnitComplex, Vector3};

use super::{
    LineError, lines, numbers,
    plane::{Matrix, project},
    stamped,
};
use crate::dataset::stamp;
use gyre_radar::trajectory::Trajectory;

/// A first pose that is nearer to the identity than this, m and in each element of the rotation, is
/// the world.
const NEAR_IDENTITY: f64 = 0.1;

pub(super) fn parse(text: &str) -> Result<Trajectory, LineError> {
    let first = lines(text).next();
    if first.is_some_and(|(_, row)| leading_stamp(row).is_some()) {
        return parse_boreas(text);
    }
    let mut matrices = Vec::new();
    for (line, row) in lines(text) {
        let leading = usize::from(row.split_whitespace().count() == 13);
        matrices.push(numbers::<12>(line, row.split_whitespace().skip(leading))?);
    }
    Ok(Trajectory {
        stamp_ns: None,
        poses: project(&matrices)?.into_iter().map(planar).collect(),
    })
}

/// Parses a file of Boreas. Its poses have roll and pitch: they are inverted in space, and
/// projected to the plane at last.
fn parse_boreas(text: &str) -> Result<Trajectory, LineError> {
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
    Ok(Trajectory {
        stamp_ns: Some(stamps),
        poses,
    })
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
