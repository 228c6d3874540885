//! Boreas `radar_poses.csv`, or the poses of the lidar: poses of the sensor in east-north-up; its
//! frame is x forward, y right, z down (roll near pi).

use gyre_geometry::pose;

use super::{LineError, columns, lines, number, stamp_field, stamped};
use gyre_radar::trajectory::Trajectory;

/// The names of the column of times, in order of precedence.
pub(super) const TIMES: [&str; 2] = ["GPSTime", "ROSTime"];

pub(super) fn parse(text: &str) -> Result<Trajectory, LineError> {
    let mut rows = lines(text);
    let header = rows.next().map(|(_, header)| header).unwrap_or_default();
    let time = TIMES.into_iter().find(|name| header.contains(name));
    let [time] = columns(header, [time.unwrap_or(TIMES[0])])?;
    let [east, north] = columns(header, ["easting", "northing"])?;
    let [roll, pitch, heading] = columns(header, ["roll", "pitch", "heading"])?;
    let (stamps, poses) = stamped(rows, |line, row| {
        let number = |column| number(line, row, column);
        let yaw = forward_heading(number(roll)?, number(pitch)?, number(heading)?);
        let pose = pose(number(east)?, number(north)?, yaw);
        Ok((stamp_field(line, row, time)?, pose))
    })?;
    Ok(Trajectory {
        stamp_ns: Some(stamps),
        poses,
    })
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
