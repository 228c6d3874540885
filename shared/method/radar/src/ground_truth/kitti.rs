//! KITTI: twelve numbers per line, a row-major 3 x 4 pose, after an optional index. Also Boreas
//! odometry files, whose 13 columns are a stamp and the inverse of the pose.

use std::io::{self, Write};

use gyre_geometry::mirrored;

use super::{LineError, check_increasing, lines, numbers};
use crate::dataset::stamp;
use crate::trajectory::{Trajectory, planar};

pub(super) fn parse(text: &str) -> Result<Trajectory, LineError> {
    let stamped = lines(text)
        .next()
        .and_then(|(_, row)| leading_stamp(row))
        .is_some();
    let mut stamps = stamped.then(Vec::new);
    let mut poses = Vec::new();
    for (line, row) in lines(text) {
        let leading = usize::from(row.split_whitespace().count() == 13);
        let pose = planar(&numbers::<12>(line, row.split_whitespace().skip(leading))?);
        match &mut stamps {
            None => poses.push(pose),
            Some(stamps) => {
                let stamp = leading_stamp(row);
                let stamp = stamp.ok_or_else(|| LineError {
                    line,
                    reason: "the first column is not a time, as in the first line".to_owned(),
                })?;
                check_increasing(line, stamps, stamp)?;
                stamps.push(stamp);
                // The first frame in the current sensor frame, y right: invert, then mirror to y
                // left.
                poses.push(mirrored(&pose.inverse()));
            }
        }
    }
    Ok(Trajectory {
        stamp_ns: stamps,
        poses,
    })
}

fn leading_stamp(row: &str) -> Option<i64> {
    let mut words = row.split_whitespace();
    let first = words.next()?;
    (words.count() == 12)
        .then(|| first.parse().ok().and_then(stamp::to_ns))
        .flatten()
}

/// Writes KITTI poses in the plane (z = 0).
///
/// # Errors
/// Errors of `out`.
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
