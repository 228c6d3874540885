//! `vision_msgs`: detected objects, as its versions 4 of ROS 2 Humble and later have them.

use serde::{Deserialize, Serialize};

use crate::{
    definition::message,
    geometry_msgs::{Pose, PoseWithCovariance, Vector3},
    std_msgs::Header,
};

/// A class that an object may be of.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ObjectHypothesis {
    /// The name of the class.
    pub class_id: String,
    /// The probability, 0 to 1.
    pub score: f64,
}
message!(
    ObjectHypothesis,
    "vision_msgs",
    "string class_id\nfloat64 score\n",
    []
);

/// A class that an object may be of, and its pose if it is.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ObjectHypothesisWithPose {
    pub hypothesis: ObjectHypothesis,
    pub pose: PoseWithCovariance,
}
message!(
    ObjectHypothesisWithPose,
    "vision_msgs",
    "ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose\n",
    [ObjectHypothesis, PoseWithCovariance]
);

/// A box that may be turned.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BoundingBox3D {
    /// The centre, and the directions of the sides.
    pub center: Pose,
    /// The lengths of the sides, m.
    pub size: Vector3,
}
message!(
    BoundingBox3D,
    "vision_msgs",
    "geometry_msgs/Pose center\ngeometry_msgs/Vector3 size\n",
    [Pose, Vector3]
);

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Detection3D {
    pub header: Header,
    /// The classes that it may be of.
    pub results: Vec<ObjectHypothesisWithPose>,
    pub bbox: BoundingBox3D,
    /// The identity, which later messages repeat.
    pub id: String,
}
message!(
    Detection3D,
    "vision_msgs",
    "std_msgs/Header header\nObjectHypothesisWithPose[] results\nBoundingBox3D bbox\nstring id\n",
    [Header, ObjectHypothesisWithPose, BoundingBox3D]
);

/// The objects at one time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Detection3DArray {
    pub header: Header,
    pub detections: Vec<Detection3D>,
}
message!(
    Detection3DArray,
    "vision_msgs",
    "std_msgs/Header header\nDetection3D[] detections\n",
    [Header, Detection3D]
);
