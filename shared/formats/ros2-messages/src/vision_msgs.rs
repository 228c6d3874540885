//! `vision_msgs`: detected objects, as its versions 4 of ROS 2 Humble and later have them.

use crate::{
    definition::package,
    geometry_msgs::{Pose, PoseWithCovariance, Vector3},
    std_msgs::Header,
};

package! { vision_msgs:
    /// A class that an object may be of, and its probability, 0 to 1.
    struct ObjectHypothesis {
        class_id: String = "string class_id",
        score: f64 = "float64 score",
    }

    struct ObjectHypothesisWithPose {
        hypothesis: ObjectHypothesis = "ObjectHypothesis hypothesis",
        pose: PoseWithCovariance = "geometry_msgs/PoseWithCovariance pose",
    }

    /// A box that may be turned, with the lengths of its sides, m.
    #[derive(Copy)]
    struct BoundingBox3D {
        center: Pose = "geometry_msgs/Pose center",
        size: Vector3 = "geometry_msgs/Vector3 size",
    }

    struct Detection3D {
        header: Header = "std_msgs/Header header",
        results: Vec<ObjectHypothesisWithPose> = "ObjectHypothesisWithPose[] results",
        bbox: BoundingBox3D = "BoundingBox3D bbox",
        /// The identity, which later messages repeat.
        id: String = "string id",
    }

    struct Detection3DArray {
        header: Header = "std_msgs/Header header",
        detections: Vec<Detection3D> = "Detection3D[] detections",
    }
}
