//! The input and the output of the tracking.

use gyre_geometry::{Pose, Twist};
use nalgebra::{Matrix2, Point2, Vector2};

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

/// A moving object at the time of a scan, in the frame of the odometry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Object {
    /// The identity: counted from 1, and given to no other object of the run.
    pub id: u64,
    /// The centre, m.
    pub position: Point2<f64>,
    /// The velocity over ground, m/s.
    pub velocity: Vector2<f64>,
    /// The heading, rad: the direction of the velocity, and of what is slow that by the network.
    pub yaw_rad: f64,
    /// The length along the heading, m.
    pub length_m: f64,
    /// The width across it, m.
    pub width_m: f64,
    /// False if its speed is not significantly above that of what stands.
    pub moving: bool,
    /// Scans since it was first seen, that one included.
    pub age: u32,
    /// Covariance of the centre, m².
    pub position_covariance: Matrix2<f64>,
    /// Covariance of the velocity, (m/s)².
    pub velocity_covariance: Matrix2<f64>,
}
