//! `geometry_msgs`: poses, twists and transforms. Frames follow REP-103, lengths are in m, angles
//! in rad.

use gyre_samples::Sample;
use serde::{Deserialize, Serialize};

use crate::{definition::message, std_msgs::Header};

/// A covariance of six values in the order of ROS, x, y, z, roll, pitch, yaw, by rows.
///
/// `serde` knows arrays up to 32 elements; two of 18 are the same bytes in CDR.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Covariance([[f64; 18]; 2]);

/// Number of values of a pose or a twist.
pub const VALUES: usize = 6;

impl Covariance {
    /// Returns the element of a row and a column, both below [`VALUES`].
    ///
    /// # Panics
    /// For a row or a column past the end.
    pub fn at(&self, row: usize, column: usize) -> f64 {
        assert!(row < VALUES && column < VALUES, "{row}, {column}");
        self.0.as_flattened()[row * VALUES + column]
    }

    /// Sets the element of a row and a column, both below [`VALUES`].
    ///
    /// # Panics
    /// For a row or a column past the end.
    pub fn set(&mut self, row: usize, column: usize, value: f64) {
        assert!(row < VALUES && column < VALUES, "{row}, {column}");
        self.0.as_flattened_mut()[row * VALUES + column] = value;
    }

    /// Returns all elements by rows.
    pub fn elements(&self) -> &[f64] {
        self.0.as_flattened()
    }
}

/// A position, m.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Forward, m.
    pub x: f64,
    /// To the left, m.
    pub y: f64,
    /// Up, m.
    pub z: f64,
}
message!(
    Point,
    "geometry_msgs",
    "float64 x\nfloat64 y\nfloat64 z\n",
    []
);

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Vector3 {
    /// Forward.
    pub x: f64,
    /// To the left.
    pub y: f64,
    /// Up.
    pub z: f64,
}
message!(
    Vector3,
    "geometry_msgs",
    "float64 x\nfloat64 y\nfloat64 z\n",
    []
);

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quaternion {
    /// The vector's x.
    pub x: f64,
    /// The vector's y.
    pub y: f64,
    /// The vector's z.
    pub z: f64,
    /// The scalar.
    pub w: f64,
}
message!(
    Quaternion,
    "geometry_msgs",
    "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n",
    []
);

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

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// The position, m.
    pub position: Point,
    pub orientation: Quaternion,
}
message!(
    Pose,
    "geometry_msgs",
    "Point position\nQuaternion orientation\n",
    [Point, Quaternion]
);

/// A pose with covariance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PoseWithCovariance {
    pub pose: Pose,
    /// The covariance, along the axes of the frame of the pose.
    pub covariance: Covariance,
}
message!(
    PoseWithCovariance,
    "geometry_msgs",
    "Pose pose\nfloat64[36] covariance\n",
    [Pose]
);

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Twist {
    /// Linear, m/s.
    pub linear: Vector3,
    /// Angular, rad/s.
    pub angular: Vector3,
}
message!(
    Twist,
    "geometry_msgs",
    "Vector3 linear\nVector3 angular\n",
    [Vector3]
);

/// A velocity at a time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TwistStamped {
    pub header: Header,
    pub twist: Twist,
}
message!(
    TwistStamped,
    "geometry_msgs",
    "std_msgs/Header header\nTwist twist\n",
    [Header, Twist]
);

impl TwistStamped {
    /// Returns the speed ahead as a sample of the wheels, on the driver's clock: see
    /// [`Header::stamp_or`].
    pub fn sample(&self, received_ns: i64) -> Sample {
        Sample::speed(self.header.stamp_or(received_ns), self.twist.linear.x)
    }
}

/// A velocity with covariance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TwistWithCovariance {
    pub twist: Twist,
    /// The covariance, in (m/s)^2, (rad/s)^2 and their products.
    pub covariance: Covariance,
}
message!(
    TwistWithCovariance,
    "geometry_msgs",
    "Twist twist\nfloat64[36] covariance\n",
    [Twist]
);

/// The pose of a frame in another frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Transform {
    /// The position, m.
    pub translation: Vector3,
    pub rotation: Quaternion,
}
message!(
    Transform,
    "geometry_msgs",
    "Vector3 translation\nQuaternion rotation\n",
    [Vector3, Quaternion]
);

/// The pose of the frame `child_frame_id` in the frame of the header, at its time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TransformStamped {
    pub header: Header,
    pub child_frame_id: String,
    pub transform: Transform,
}
message!(
    TransformStamped,
    "geometry_msgs",
    "std_msgs/Header header\nstring child_frame_id\nTransform transform\n",
    [Header, Transform]
);
