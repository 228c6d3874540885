//! The poses of a run, and the objects at each.

use gyre_geometry::{Pose, UncertainMotion};
use gyre_messages::{ListedObject, PoseHeader, flag, outcome};
use gyre_ros2_messages::frames::Interval;

/// A pose of the radar with what led to it.
#[derive(Clone, Debug)]
pub struct Place {
    /// The number of the scan in the run.
    pub seq: u64,
    /// Time of the scan, ns since 1970.
    pub stamp_ns: i64,
    /// The pose in the frame of the first scan.
    pub pose: UncertainMotion,
    /// The motion from the previous scan; `None` where the chain of motions begins.
    pub since: Option<Interval>,
    /// The pose of the odometry frame in the map frame, with SLAM.
    pub map_from_odometry: Option<Pose>,
    /// The objects, of a run that tracks them; `None` where they are not known.
    pub objects: Option<Vec<ListedObject>>,
}

impl Place {
    /// Returns the place of a pose of a run; `None` for the end of the stream.
    pub fn of(pose: &PoseHeader) -> Option<Self> {
        if pose.item.is(flag::END) {
            return None;
        }
        let motion = pose.motion.motion();
        let since = Interval {
            motion: UncertainMotion {
                motion: motion.motion,
                covariance: motion.covariance,
            },
            duration_ns: pose.motion.interval_ns,
            is_measured: pose.motion.refinement.outcome != outcome::PREDICTED,
        };
        Some(Self {
            seq: pose.item.seq,
            stamp_ns: pose.item.stamp_ns,
            pose: pose.pose(),
            since: (!pose.item.is(flag::BREAK)).then_some(since),
            map_from_odometry: None,
            objects: None,
        })
    }
}
