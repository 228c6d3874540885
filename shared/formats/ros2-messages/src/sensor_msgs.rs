//! `sensor_msgs`: images, and the measurements of inertial sensors and GNSS receivers.

use gyre_samples::{RawFix, Sample, SampleKind};
use serde::{Deserialize, Serialize};

use crate::{
    definition::message,
    geometry_msgs::{Quaternion, Vector3},
    std_msgs::Header,
};

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Image {
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

/// An image as a file.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CompressedImage {
    pub header: Header,
    /// The format of the file, such as `png`.
    pub format: String,
    /// The bytes of the file.
    #[serde(with = "serde_bytes")]
    pub data: Vec<u8>,
}
message!(
    CompressedImage,
    "sensor_msgs",
    "std_msgs/Header header\nstring format\nuint8[] data\n",
    [Header]
);

/// A sample of an inertial sensor. Covariances are 3 x 3, by rows; the first element is negative
/// (-1) where there is no such measurement.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Imu {
    pub header: Header,
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

impl Imu {
    /// Returns the rates and accelerations as a sample, in the sensor's own axes and on its own
    /// clock ([`Header::stamp_or`]). Rates that it did not measure are not a number, accelerations
    /// zero.
    pub fn sample(&self, received_ns: i64) -> Sample {
        let values = |of: Vector3, covariance: [f64; 9], unmeasured: f64| match covariance[0] < 0.0
        {
            true => [unmeasured; 3],
            false => [of.x, of.y, of.z],
        };
        let covariance = self.angular_velocity_covariance;
        let [x, y, z] = values(self.angular_velocity, covariance, f64::NAN);
        let covariance = self.linear_acceleration_covariance;
        let [along_x, along_y, along_z] = values(self.linear_acceleration, covariance, 0.0);
        Sample {
            stamp_ns: self.header.stamp_or(received_ns),
            kind: SampleKind::Gyro as u32,
            reserved: 0,
            values: [x, y, z, along_x, along_y, along_z],
        }
    }
}

/// The kind of a fix of a GNSS receiver, and the systems that it is of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct NavSatStatus {
    /// 0 for a fix, 1 and 2 for one that is augmented by satellites or on the ground; -1 without a
    /// fix; -2 where the driver does not state it, as by default from ROS 2 Jazzy on.
    pub status: i8,
    /// The systems, a bit each: GPS, GLONASS, BeiDou, Galileo.
    pub service: u16,
}
message!(
    NavSatStatus,
    "sensor_msgs",
    "int8 status\nuint16 service\n",
    []
);

/// A fix of a GNSS receiver on the ellipsoid of WGS 84.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NavSatFix {
    /// Time, and the frame of the antenna.
    pub header: Header,
    /// The kind of the fix.
    pub status: NavSatStatus,
    /// Latitude, degrees.
    pub latitude: f64,
    /// Longitude, degrees.
    pub longitude: f64,
    /// Altitude above the ellipsoid, m; NaN where it is not known.
    pub altitude: f64,
    /// Covariance along east, north and up, by rows, m².
    pub position_covariance: [f64; 9],
    /// 0 if the covariance is not known; 1 to 3 for an approximation, its diagonal, all of it.
    pub position_covariance_type: u8,
}
message!(
    NavSatFix,
    "sensor_msgs",
    "std_msgs/Header header\nsensor_msgs/NavSatStatus status\nfloat64 latitude\nfloat64 longitude\n\
     float64 altitude\nfloat64[9] position_covariance\nuint8 position_covariance_type\n",
    [Header, NavSatStatus]
);

/// The lowest status of a fix, and the status of a driver that does not state it.
const FIX: i8 = 0;
const STATUS_UNKNOWN: i8 = -2;
/// The type of a covariance that is not known.
const COVARIANCE_UNKNOWN: u8 = 0;

impl NavSatFix {
    /// Returns the fix on the driver's clock ([`Header::stamp_or`]); `None` if the receiver had
    /// none.
    pub fn fix(&self, received_ns: i64) -> Option<RawFix> {
        let sigma_m = match self.position_covariance_type {
            COVARIANCE_UNKNOWN => 0.0,
            _ => RawFix::sigma_of([0, 4].map(|at| self.position_covariance[at])),
        };
        let status_is_unknown = self.status.status == STATUS_UNKNOWN;
        (self.status.status >= FIX || status_is_unknown).then_some(RawFix {
            stamp_ns: self.header.stamp_or(received_ns),
            at: [self.latitude, self.longitude],
            altitude_m: self.altitude,
            sigma_m,
            status_is_unknown,
        })
    }

    /// Returns the line that a live receiver would send: its time, ns, latitude and longitude,
    /// degrees, and the standard deviation, m, or 0; without a fix the time alone.
    pub fn line(&self, received_ns: i64) -> String {
        match self.fix(received_ns) {
            Some(fix) => {
                let (stamp_ns, [latitude, longitude]) = (fix.stamp_ns, fix.at);
                format!("{stamp_ns},{latitude},{longitude},{}", fix.sigma_m)
            }
            None => format!("{},,", self.header.stamp_or(received_ns)),
        }
    }
}
