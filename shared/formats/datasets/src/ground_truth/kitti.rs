//! KITTI: twelve numbers per line, a row-major 3 x 4 pose, after an optional index.

use std::io::{self, Write};

use gyre_geometry::Pose;
use nalgebra::{Complex, Translation2, Unit, UnitComplex};

use super::{LineError, lines, numbers, plane::project};
use crate::dataset::stamp;
use gyre_radar::trajectory::Trajectory;

pub(super) fn parse(text: &str) -> Result<Trajectory, LineError> {
    let mut matrices = Vec::new();
    for (line, row) in lines(text) {
        let words = || row.split_whitespace();
        let index = words().next().filter(|_| words().count() == 13);
        let index = index.and_then(|index| index.parse().ok());
        if index.and_then(stamp::to_ns).is_some() {
            let reason = "the first of its 13 columns is a time, and KITTI has an index there";
            return Err(LineError::new(line, reason));
        }
        let leading = usize::from(words().count() == 13);
        matrices.push(numbers::<12>(line, words().skip(leading))?);
    }
    Ok(Trajectory {
        stamp_ns: None,
        poses: project(&matrices)?.into_iter().map(planar).collect(),
    })
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
