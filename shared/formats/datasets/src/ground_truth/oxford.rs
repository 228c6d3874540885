//! Oxford `radar_odometry.csv`: each row is the pose of the later scan (source) in the frame of the
//! earlier one (destination), x forward, y right, yaw clockwise; stamps are at mid-sweep.

use gyre_geometry::{Pose, mirrored, pose};

use super::{LineError, columns, lines, number, stamp_field};
use gyre_radar::trajectory::Trajectory;

struct Motion {
    line: usize,
    from_ns: i64,
    to_ns: i64,
    /// The later scan in the frame of the earlier one, REP-103.
    motion: Pose,
}

/// Composes the motions from the identity. Rows may be in any order; a gap between them is an
/// error.
pub(super) fn parse(text: &str) -> Result<Trajectory, LineError> {
    let mut motions = parse_rows(text)?;
    motions.sort_by_key(|m| m.from_ns);
    let none = || LineError::new(1, "the file has a header but no motion");
    let first = motions.first().ok_or_else(none)?;
    let (mut stamps, mut poses) = (vec![first.from_ns], vec![Pose::identity()]);
    let (mut now_ns, mut now) = (first.from_ns, Pose::identity());
    for m in &motions {
        check_chain(m, now_ns)?;
        (now_ns, now) = (m.to_ns, now * m.motion);
        stamps.push(now_ns);
        poses.push(now);
    }
    Ok(Trajectory {
        stamp_ns: Some(stamps),
        poses,
    })
}

fn parse_rows(text: &str) -> Result<Vec<Motion>, LineError> {
    let mut rows = lines(text);
    let header = rows.next().map(|(_, header)| header).unwrap_or_default();
    let names = ["source_timestamp", "destination_timestamp", "x", "y", "yaw"];
    let [source, destination, x, y, yaw] = columns(header, names)?;
    rows.map(|(line, row)| {
        let number = |column| number(line, row, column);
        let motion = pose(number(x)?, number(y)?, number(yaw)?);
        Ok(Motion {
            line,
            from_ns: stamp_field(line, row, destination)?,
            to_ns: stamp_field(line, row, source)?,
            motion: mirrored(&motion),
        })
    })
    .collect()
}

fn check_chain(m: &Motion, now_ns: i64) -> Result<(), LineError> {
    if m.to_ns <= m.from_ns {
        let reason = "the source scan must be later than the destination scan";
        return Err(LineError::new(m.line, reason));
    }
    if m.from_ns != now_ns {
        let gap_s = (m.from_ns - now_ns) as f64 * 1e-9;
        let reason = format!(
            "this motion starts {gap_s:.6} s after the end of the previous one: the motions have a gap or an overlap"
        );
        return Err(LineError::new(m.line, reason));
    }
    Ok(())
}
