//! `correction`: the odometry frame in the map frame.

use bytemuck::{Pod, Zeroable};
use gyre_geometry::{Pose as PlanarPose, covariance, pose};

use crate::{
    check::{Violation, covariance as check_covariance, fields, planar, require},
    follower::FollowerId,
    item::Item,
    limits::Limits,
    message::{Sender, header, message},
    pose::MAX_DISTANCE_M,
};

message! {
    /// The transform that corrects poses of the odometry. Odometry is continuous and drifts; the
    /// correction jumps when a loop is closed (REP-105: the transform from `map` to `odom`).
    Correction: "correction", CorrectionHeader, Sender::Follower(FollowerId::Trajectory),
    0 readers, Latest
}
header!(CorrectionHeader, "gyre_correction_header_v4");

/// The pose of the odometry frame in the map frame: x forward, y to the left, yaw
/// counter-clockwise, in (-pi, pi].
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct CorrectionHeader {
    /// `seq` counts the records read from the logs, from 0; their ends count as one. `scan` and the
    /// times are the newest keyframe's.
    pub item: Item,
    pub keyframe_seq: u64,
    pub keyframes: u64,
    pub loops: u64,
    pub x_m: f64,
    pub y_m: f64,
    pub yaw_rad: f64,
    /// Covariance of (x, y, yaw) of the newest keyframe's pose in the map frame, not scaled by
    /// residuals.
    pub keyframe_covariance: covariance::Packed,
}

impl CorrectionHeader {
    fn check_content(&self, _: &[u8], _: &Limits) -> Result<(), Violation> {
        planar(fields![self; x_m y_m yaw_rad], MAX_DISTANCE_M)?;
        check_covariance(&self.keyframe_covariance)?;
        require(self.keyframes > 0, "keyframes", self.keyframes, "1 or more")
    }

    /// Returns the transform from the odometry frame to the map frame: applied to a pose of the
    /// odometry, it gives the pose in the map.
    pub fn map_from_odometry(&self) -> PlanarPose {
        pose(self.x_m, self.y_m, self.yaw_rad)
    }
}
