//! The returns of a scan in the frame of the odometry.

use gyre_geometry::{Pose, SparsePoint, Twist};
use nalgebra::{Point2, Vector2};

/// A scan with its pose and motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlacedScan {
    /// Time of the scan, the middle of the sweep, ns.
    pub stamp_ns: i64,
    /// The pose of the sensor at that time, in the frame of the odometry.
    pub pose: Pose,
    /// The velocity of the sensor during the sweep, by which the points are deskewed: that of the
    /// motion from the scan before, by [`Twist::from_chord`].
    pub twist: Twist,
}

/// A return, as if the sensor had stood and the object that reflects it too.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Return {
    /// Position in the frame of the odometry at the time of its azimuth, m.
    pub at: Point2<f64>,
    /// Unit vector from the sensor to it.
    pub direction: Vector2<f64>,
    /// Range, m.
    pub range_m: f64,
    /// Time of its azimuth relative to the scan's, s.
    pub time_s: f64,
    /// Metres by which a velocity of 1 m/s away from the sensor lengthens the measured range.
    pub doppler_s: f64,
    /// Weight from 0 to 1.
    pub weight: f64,
}

impl Return {
    /// Returns where it would be at the scan's time if it moves with a velocity, m.
    pub fn at_scan(&self, velocity: &Vector2<f64>) -> Point2<f64> {
        let away_mps = self.direction.dot(velocity);
        self.at - velocity * self.time_s - self.direction * (self.doppler_s * away_mps)
    }
}

/// Places the points of a scan up to a range.
pub(crate) fn place(
    scan: &PlacedScan,
    points: &[SparsePoint],
    max_range_m: f64,
    returns: &mut Vec<Return>,
) {
    returns.clear();
    for point in points.iter().filter(|point| point.weight > 0.0) {
        let there = point.deskewed(&scan.twist);
        let sensor = scan
            .twist
            .chord_pose_at(point.time_s.into())
            .translation
            .vector;
        let ray = there.coords - sensor;
        let range_m = ray.norm();
        if !(range_m > 0.0 && range_m <= max_range_m) {
            continue;
        }
        returns.push(Return {
            at: scan.pose * there,
            direction: scan.pose.rotation * (ray / range_m),
            range_m,
            time_s: point.time_s.into(),
            doppler_s: point.doppler_s.into(),
            weight: point.weight.into(),
        });
    }
}
