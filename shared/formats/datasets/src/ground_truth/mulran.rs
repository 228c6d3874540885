//! MulRan `global_pose.csv`: time and row-major 3 x 4 pose of the vehicle (x forward, y left, z up)
//! in UTM, without header.

use gyre_geometry::{Pose, pose};
use nalgebra::{Matrix3, Vector3};

use super::{LineError, lines, numbers, stamp_field, stamped};
use gyre_radar::trajectory::Trajectory;

/// Position of the radar in the vehicle frame, m.
const RADAR_IN_BASE_M: [f64; 3] = [1.50, -0.04, 1.97];
/// Yaw of the radar in the vehicle frame, degrees.
const RADAR_YAW_DEG: f64 = 0.9;

/// Parses poses of the radar. Coordinates of the order of 1e6 m require `f64`.
pub(super) fn parse(text: &str) -> Result<Trajectory, LineError> {
    let (stamps, poses) = stamped(lines(text), |line, row| {
        let stamp = stamp_field(line, row, 0)?;
        let matrix = numbers::<12>(line, row.split(',').skip(1))?;
        Ok((stamp, radar_pose(&matrix)))
    })?;
    Ok(Trajectory {
        stamp_ns: Some(stamps),
        poses,
    })
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
        let trajectory = parse(text).unwrap();
        let pose = trajectory.poses[0];
        assert!((pose.translation.x - (353_062.123456789 + 0.04)).abs() < 1e-8);
        assert!((pose.translation.y - (4_026_023.987654321 + 1.5)).abs() < 1e-8);
        assert!((pose.rotation.angle().to_degrees() - 90.9).abs() < 1e-9);
        assert_eq!(trajectory.stamp_ns.unwrap()[0], 1_561_000_444_390_857_630);
    }
}
