//! `sensor_msgs`: images, and what an inertial sensor measures.

use gyre_samples::{Sample, SampleKind};
use serde::{Deserialize, Serialize};

use crate::{
    definition::message,
    geometry_msgs::{Quaternion, Vector3},
    std_msgs::Header,
};

/// An image.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Image {
    /// Time and frame.
    pub header: Header,
    /// Rows.
    pub height: u32,
    /// Columns.
    pub width: u32,
    /// The encoding of a pixel, such as `mono8` or `8UC1`.
    pub encoding: String,
    /// 1 if pixels of several bytes are big-endian.
    pub is_bigendian: u8,
    /// Bytes of a row.
    pub step: u32,
    /// The pixels by rows.
    #[serde(with = "serde_bytes")]
    pub data: Vec<u8>,
}
message!(
    Image,
    "sensor_msgs",
    "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\n\
     uint32 step\nuint8[] data\n",
    [Header]
);

/// A sample of an inertial sensor. Covariances are 3 x 3, by rows; the first element is -1 where
/// there is no such measurement.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Imu {
    /// Time and frame.
    pub header: Header,
    /// The orientation.
    pub orientation: Quaternion,
    /// Covariance of the orientation.
    pub orientation_covariance: [f64; 9],
    /// Rates about the axes, rad/s.
    pub angular_velocity: Vector3,
    /// Covariance of the rates.
    pub angular_velocity_covariance: [f64; 9],
    /// Acceleration along the axes, m/s².
    pub linear_acceleration: Vector3,
    /// Covariance of the acceleration.
    pub linear_acceleration_covariance: [f64; 9],
}
message!(
    Imu,
    "sensor_msgs",
    "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n\
     geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n\
     geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n",
    [Header, Quaternion, Vector3]
);

/// The first element of a covariance where nothing is measured.
const NOT_MEASURED: f64 = -1.0;

impl Imu {
    /// Returns the rates and accelerations as a sample, in the sensor's own axes and on its own
    /// clock ([`Header::stamp_or`]); `None` if it measures no rates.
    pub fn sample(&self, received_ns: i64) -> Option<Sample> {
        let (turn, along) = (self.angular_velocity, self.linear_acceleration);
        let sample = Sample {
            stamp_ns: self.header.stamp_or(received_ns),
            kind: SampleKind::Gyro as u32,
            reserved: 0,
            values: [turn.x, turn.y, turn.z, along.x, along.y, along.z],
        };
        (self.angular_velocity_covariance[0] != NOT_MEASURED).then_some(sample)
    }
}
