//! `sensor_msgs`: images, and the measurements of inertial sensors and GNSS receivers.

use gyre_geometry::samples::{Sample, SampleKind};

use crate::{
    definition::package,
    geometry_msgs::{Quaternion, Vector3},
    std_msgs::Header,
};

package! { sensor_msgs:
    struct Image {
        header: Header = "std_msgs/Header header",
        height: u32 = "uint32 height",
        width: u32 = "uint32 width",
        /// The encoding of a pixel, such as `mono8` or `8UC1`.
        encoding: String = "string encoding",
        is_bigendian: u8 = "uint8 is_bigendian",
        /// Bytes of a row.
        step: u32 = "uint32 step",
        #[serde(with = "serde_bytes")]
        data: Vec<u8> = "uint8[] data",
    }

    /// An image as a file, such as `png`.
    struct CompressedImage {
        header: Header = "std_msgs/Header header",
        format: String = "string format",
        #[serde(with = "serde_bytes")]
        data: Vec<u8> = "uint8[] data",
    }

    /// A sample of an inertial sensor. Covariances are 3 x 3, by rows; the first element is
    /// negative (-1) where there is no such measurement.
    struct Imu {
        header: Header = "std_msgs/Header header",
        orientation: Quaternion = "geometry_msgs/Quaternion orientation",
        orientation_covariance: [f64; 9] = "float64[9] orientation_covariance",
        /// Rates about the axes, rad/s.
        angular_velocity: Vector3 = "geometry_msgs/Vector3 angular_velocity",
        angular_velocity_covariance: [f64; 9] = "float64[9] angular_velocity_covariance",
        /// Acceleration along the axes, m/s².
        linear_acceleration: Vector3 = "geometry_msgs/Vector3 linear_acceleration",
        linear_acceleration_covariance: [f64; 9] = "float64[9] linear_acceleration_covariance",
    }

    /// The kind of a fix of a GNSS receiver, and the systems that it is of.
    #[derive(Copy)]
    struct NavSatStatus {
        /// 0 for a fix, 1 and 2 for one that is augmented by satellites or on the ground; -1
        /// without a fix; -2 where the driver does not state it, as by default from ROS 2 Jazzy on.
        status: i8 = "int8 status",
        /// The systems, a bit each: GPS, GLONASS, BeiDou, Galileo.
        service: u16 = "uint16 service",
    }

    /// A fix of a GNSS receiver on the ellipsoid of WGS 84.
    struct NavSatFix {
        /// Time, and the frame of the antenna.
        header: Header = "std_msgs/Header header",
        status: NavSatStatus = "sensor_msgs/NavSatStatus status",
        /// Degrees.
        latitude: f64 = "float64 latitude",
        /// Degrees.
        longitude: f64 = "float64 longitude",
        /// Altitude above the ellipsoid, m; NaN where it is not known.
        altitude: f64 = "float64 altitude",
        /// Covariance along east, north and up, by rows, m².
        position_covariance: [f64; 9] = "float64[9] position_covariance",
        /// 0 if the covariance is not known; 1 to 3 for an approximation, its diagonal, all of it.
        position_covariance_type: u8 = "uint8 position_covariance_type",
    }
}

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
        let values = [x, y, z, along_x, along_y, along_z];
        Sample::of(SampleKind::Gyro, self.header.stamp_or(received_ns), values)
    }
}

/// The lowest status of a fix, and the status of a driver that does not state it.
const FIX: i8 = 0;
const STATUS_UNKNOWN: i8 = -2;
/// The type of a covariance that is not known.
const COVARIANCE_UNKNOWN: u8 = 0;

impl NavSatFix {
    /// Returns the fix on the driver's clock ([`Header::stamp_or`]); `None` if the receiver had
    /// none.
    pub fn fix(&self, received_ns: i64) -> Option<Sample> {
        let sigma_m = match self.position_covariance_type {
            COVARIANCE_UNKNOWN => 0.0,
            _ => Sample::sigma_of([0, 4].map(|at| self.position_covariance[at])),
        };
        let (stamp_ns, at) = (
            self.header.stamp_or(received_ns),
            [self.latitude, self.longitude],
        );
        let mut fix = Sample::fix(stamp_ns, at, self.altitude, sigma_m);
        let status_is_unknown = self.status.status == STATUS_UNKNOWN;
        fix.values[4] = f64::from(status_is_unknown);
        (self.status.status >= FIX || status_is_unknown).then_some(fix)
    }
}
