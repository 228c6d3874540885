//! The ground truth of Oxford, Boreas and MulRan: tables with commas.

use gyre_geometry::{Pose, mirrored, pose};
use gyre_radar::trajectory::Trajectory;
use nalgebra::{Matrix3, Vector3};

use super::{LineError, columns, lines, number, numbers, stamp_field, stamped};

/// The names of the column of times, in order of precedence.
pub(super) const TIMES: [&str; 2] = ["GPSTime", "ROSTime"];
/// Position of the radar in the vehicle frame, m.
const RADAR_IN_BASE_M: [f64; 3] = [1.50, -0.04, 1.97];
/// Yaw of the radar in the vehicle frame, degrees.
const RADAR_YAW_DEG: f64 = 0.9;

struct Motion {
    line: usize,
    from_ns: i64,
    to_ns: i64,
    /// The later scan in the frame of the earlier one, REP-103.
    motion: Pose,
}

/// Parses Oxford `radar_odometry.csv`: each row is the pose of the later scan (source) in the frame
/// of the earlier one (destination), x forward, y right, yaw clockwise; stamps are at mid-sweep.
///
/// Composes the motions from the identity. Rows may be in any order; a gap between them is an
/// error.
pub(super) fn oxford(text: &str) -> Result<Trajectory, LineError> {
    let mut motions = motions(text)?;
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
    Ok(Trajectory::timed(stamps, poses))
}

fn motions(text: &str) -> Result<Vec<Motion>, LineError> {
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

/// Parses Boreas `radar_poses.csv`, or the poses of the lidar: poses of the sensor in
/// east-north-up; its frame is x forward, y right, z down (roll near pi).
pub(super) fn boreas(text: &str) -> Result<Trajectory, LineError> {
    let mut rows = lines(text);
    let header = rows.next().map(|(_, header)| header).unwrap_or_default();
    let time = TIMES.into_iter().find(|name| header.contains(name));
    let [time] = columns(header, [time.unwrap_or(TIMES[0])])?;
    let [east, north] = columns(header, ["easting", "northing"])?;
    let [roll, pitch, heading] = columns(header, ["roll", "pitch", "heading"])?;
    stamped(rows, |line, row| {
        let number = |column| number(line, row, column);
        let yaw = forward_heading(number(roll)?, number(pitch)?, number(heading)?);
        let pose = pose(number(east)?, number(north)?, yaw);
        Ok((stamp_field(line, row, time)?, pose))
    })
    .map(|(stamps, poses)| Trajectory::timed(stamps, poses))
}

/// Returns the direction of the sensor's x axis in the east-north plane, counter-clockwise from
/// east.
///
/// The rotation from sensor to ENU is `roll(r) pitch(p) yaw(h)` of transposed elementary matrices;
/// its first column is the x axis. The x axis does not depend on whether y points right (z down) or
/// left.
fn forward_heading(roll: f64, pitch: f64, heading: f64) -> f64 {
    let ((sr, cr), (sp, cp), (sh, ch)) = (roll.sin_cos(), pitch.sin_cos(), heading.sin_cos());
    let (x, y) = (cp * ch, cr * -sh + sr * sp * ch);
    y.atan2(x)
}

/// Parses MulRan `global_pose.csv` to poses of the radar: time and row-major 3 x 4 pose of the
/// vehicle (x forward, y left, z up) in UTM, without header. Coordinates of the order of 1e6 m
/// require `f64`.
pub(super) fn mulran(text: &str) -> Result<Trajectory, LineError> {
    stamped(lines(text), |line, row| {
        let stamp = stamp_field(line, row, 0)?;
        let matrix = numbers::<12>(line, row.split(',').skip(1))?;
        Ok((stamp, radar_pose(&matrix)))
    })
    .map(|(stamps, poses)| Trajectory::timed(stamps, poses))
}

fn radar_pose(m: &[f64; 12]) -> Pose {
    let rotation = Matrix3::new(m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]);
    let position = Vector3::new(m[3], m[7], m[11]) + rotation * Vector3::from(RADAR_IN_BASE_M);
    let (sin, cos) = RADAR_YAW_DEG.to_radians().sin_cos();
    let forward = rotation * Vector3::new(cos, sin, 0.0);
    pose(position.x, position.y, forward.y.atan2(forward.x))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_radar_is_ahead_of_the_vehicle_frame_for_any_origin() {
        // A vehicle heading north.
        let text = "1561000444390857630,0,-1,0,353062.123456789,1,0,0,4026023.987654321,0,0,1,20\n";
        let trajectory = mulran(text).unwrap();
        let pose = trajectory.poses[0];
        assert!((pose.translation.x - (353_062.123456789 + 0.04)).abs() < 1e-8);
        assert!((pose.translation.y - (4_026_023.987654321 + 1.5)).abs() < 1e-8);
        assert!((pose.rotation.angle().to_degrees() - 90.9).abs() < 1e-9);
        assert_eq!(trajectory.stamp_ns.unwrap()[0], 1_561_000_444_390_857_630);
    }
}
