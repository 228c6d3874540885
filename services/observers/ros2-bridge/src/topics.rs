//! The topics of the bridge: each with its name, its type, and how its messages are kept. Its
//! services are in [`services`](crate::services).

use gyre_client::RunError;
use gyre_contract::PoseHeader;
use gyre_ros2_messages::{
    diagnostic_msgs::DiagnosticArray,
    geometry_msgs::{PoseWithCovarianceStamped, TwistWithCovarianceStamped},
    nav_msgs::{OccupancyGrid, Odometry},
    rosgraph_msgs::Clock,
    tf2_msgs::TFMessage,
    vision_msgs::Detection3DArray,
    visualization_msgs::MarkerArray,
};

use crate::{
    Settings,
    node::{Keep, Node},
    outlet::Outlet,
};

/// For slow readers: 25 s at four turns a second.
const KEPT: Keep = Keep::Last(100);

pub struct Topics {
    pub of_run: RunTopics,
    /// Kept open for later readers.
    pub mounting: Outlet<TFMessage>,
    pub diagnostics: Outlet<DiagnosticArray>,
}

/// The topics of the runs, each group for a thread.
pub struct RunTopics {
    pub poses: PoseTopics,
    pub objects: ObjectTopics,
    pub doppler: Outlet<TwistWithCovarianceStamped>,
    pub fixes: Outlet<PoseWithCovarianceStamped>,
    pub map: Option<Outlet<OccupancyGrid>>,
}

pub struct PoseTopics {
    pub odometry: Outlet<Odometry>,
    /// `None` where another program provides the transforms.
    pub transforms: Option<Outlet<TFMessage>>,
    pub clock: Option<Outlet<Clock>>,
    /// True in a run whose times are the times of a replay.
    pub has_clock: bool,
    /// The stamp of the newest prediction, ns, and the pose of the newest scan.
    pub predicted_ns: Option<i64>,
    pub last: Option<PoseHeader>,
}

pub struct ObjectTopics {
    pub detections: Outlet<Detection3DArray>,
    pub markers: Outlet<MarkerArray>,
}

impl Topics {
    pub fn open(node: &mut Node, settings: &Settings) -> Result<Self, RunError> {
        let poses = PoseTopics {
            odometry: node.publish("odom", KEPT)?,
            transforms: node.publish_if(settings.transforms, "/tf", KEPT)?,
            clock: node.publish_if(settings.clock, "/clock", KEPT)?,
            has_clock: false,
            predicted_ns: None,
            last: None,
        };
        Ok(Self {
            of_run: RunTopics {
                poses,
                objects: ObjectTopics {
                    detections: node.publish("objects", KEPT)?,
                    markers: node.publish("object_markers", KEPT)?,
                },
                doppler: node.publish("doppler", KEPT)?,
                // Receivers of GNSS publish `/fix`.
                fixes: node.publish("map_fix", KEPT)?,
                map: node.publish_if(settings.map, "map", Keep::Latched)?,
            },
            mounting: node.publish("/tf_static", Keep::Latched)?,
            diagnostics: node.publish("/diagnostics", KEPT)?,
        })
    }
}
