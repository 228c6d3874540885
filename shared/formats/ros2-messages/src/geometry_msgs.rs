//! `geometry_msgs`: poses, twists and transforms. Frames follow REP-103, lengths are in m, angles
//! in rad.

use gyre_geometry::samples::Sample;
use serde::{Deserialize, Serialize};

use crate::{
    Definition, Ros2Message,
    definition::{Field, package},
    std_msgs::Header,
};

/// A covariance of six values in the order of ROS, x, y, z, roll, pitch, yaw, by rows.
///
/// `serde` knows arrays up to 32 elements; two of 18 are the same bytes in CDR.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Covariance([[f64; 18]; 2]);

/// Number of values of a pose or a twist.
pub const VALUES: usize = 6;

impl Field for Covariance {}

impl Covariance {
    /// Sets the element of a row and a column, both below [`VALUES`].
    pub fn set(&mut self, row: usize, column: usize, value: f64) {
        assert!(row < VALUES && column < VALUES, "{row}, {column}");
        self.0.as_flattened_mut()[row * VALUES + column] = value;
    }

    pub fn elements(&self) -> &[f64] {
        self.0.as_flattened()
    }
}

/// A rotation: the vector and the scalar.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quaternion {
    pub x: f64,
    pub y: f64,
    pub z: f64,
    pub w: f64,
}

impl Default for Quaternion {
    fn default() -> Self {
        Self {
            x: 0.0,
            y: 0.0,
            z: 0.0,
            w: 1.0,
        }
    }
}

impl Ros2Message for Quaternion {
    const DEFINITION: &'static Definition = &Definition {
        package: "geometry_msgs",
        name: "Quaternion",
        fields: "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n",
        parts: &[],
    };
}

impl Field for Quaternion {
    const PART: Option<&'static Definition> = Some(Self::DEFINITION);
}

package! { geometry_msgs:
    /// A position: forward, to the left and up, m.
    #[derive(Copy)]
    struct Point {
        x: f64 = "float64 x",
        y: f64 = "float64 y",
        z: f64 = "float64 z",
    }

    /// Forward, to the left and up.
    #[derive(Copy)]
    struct Vector3 {
        x: f64 = "float64 x",
        y: f64 = "float64 y",
        z: f64 = "float64 z",
    }

    #[derive(Copy)]
    struct Pose {
        position: Point = "Point position",
        orientation: Quaternion = "Quaternion orientation",
    }

    #[derive(Copy)]
    struct PoseWithCovariance {
        pose: Pose = "Pose pose",
        covariance: Covariance = "float64[36] covariance",
    }

    struct PoseWithCovarianceStamped {
        header: Header = "std_msgs/Header header",
        pose: PoseWithCovariance = "PoseWithCovariance pose",
    }

    /// Linear, m/s, and angular, rad/s.
    #[derive(Copy)]
    struct Twist {
        linear: Vector3 = "Vector3 linear",
        angular: Vector3 = "Vector3 angular",
    }

    struct TwistStamped {
        header: Header = "std_msgs/Header header",
        twist: Twist = "Twist twist",
    }

    /// A velocity with its covariance, in (m/s)^2, (rad/s)^2 and their products.
    #[derive(Copy)]
    struct TwistWithCovariance {
        twist: Twist = "Twist twist",
        covariance: Covariance = "float64[36] covariance",
    }

    struct TwistWithCovarianceStamped {
        header: Header = "std_msgs/Header header",
        twist: TwistWithCovariance = "TwistWithCovariance twist",
    }

    #[derive(Copy)]
    struct Transform {
        translation: Vector3 = "Vector3 translation",
        rotation: Quaternion = "Quaternion rotation",
    }

    /// The pose of the frame `child_frame_id` in the frame of the header, at its time.
    struct TransformStamped {
        header: Header = "std_msgs/Header header",
        child_frame_id: String = "string child_frame_id",
        transform: Transform = "Transform transform",
    }
}

impl Vector3 {
    pub(crate) fn new(x: f64, y: f64, z: f64) -> Self {
        Self { x, y, z }
    }
}

impl TwistStamped {
    /// Returns the speed ahead as a sample of the wheels, on the driver's clock: see
    /// [`Header::stamp_or`].
    pub fn sample(&self, received_ns: i64) -> Sample {
        Sample::speed(self.header.stamp_or(received_ns), self.twist.linear.x)
    }
}
