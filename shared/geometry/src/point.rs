use bytemuck::{Pod, Zeroable};
use nalgebra::Point2;

use crate::Twist;

/// One return of a scan as measured, without compensation of motion or of the Doppler shift.
///
/// With `u` the direction to the point and `v` the velocity of the sensor, the true position is
/// `(x, y) + doppler_s (u . v) u` in the sensor's frame at the time of its azimuth.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct SparsePoint {
    pub x_m: f32,
    pub y_m: f32,
    /// Time of the azimuth relative to the scan's stamp, s.
    pub time_s: f32,
    /// Weight from 0 to 1. A weight that is not above 0 counts as 0.
    pub weight: f32,
    /// Metres to add to the range for each m/s of the sensor's speed towards the point; 0 if
    /// unknown.
    pub doppler_s: f32,
}

impl SparsePoint {
    /// Returns where the point lies in the frame of its scan if the sensor has this velocity
    /// throughout: without Doppler shift and motion.
    pub fn deskewed(&self, twist: &Twist) -> Point2<f64> {
        let seen = Point2::new(f64::from(self.x_m), f64::from(self.y_m));
        let range_m = seen.coords.norm().max(1e-3);
        let approach_mps = seen.coords.dot(&twist.linear_mps()) / range_m;
        let farther = f64::from(self.doppler_s) * approach_mps / range_m;
        twist.chord_pose_at(self.time_s.into()) * (seen + seen.coords * farther)
    }
}

impl From<[f32; 5]> for SparsePoint {
    fn from(fields: [f32; 5]) -> Self {
        bytemuck::cast(fields)
    }
}

impl From<SparsePoint> for [f32; 5] {
    fn from(point: SparsePoint) -> Self {
        bytemuck::cast(point)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_ahead_of_a_moving_sensor_is_farther_than_seen_and_where_it_was_seen_from() {
        let point = SparsePoint {
            x_m: 20.0,
            time_s: 0.1,
            doppler_s: 0.04,
            ..SparsePoint::default()
        };
        let twist = Twist::from_chord(&crate::pose(2.5, 0.0, 0.0), 0.25);
        let at = point.deskewed(&twist);
        assert!((at.x - 21.4).abs() < 1e-6 && at.y.abs() < 1e-9, "{at}");
    }

    #[test]
    fn a_point_is_five_packed_floats() {
        assert_eq!(
            (size_of::<SparsePoint>(), align_of::<SparsePoint>()),
            (20, 4)
        );
    }
}
