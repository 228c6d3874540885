//! `fix`: the place of a keyframe in the map of an earlier drive.

use bytemuck::{Pod, Zeroable};
use gyre_geometry::{Pose as PlanarPose, covariance, pose};

use crate::{
    check::{Violation, code, covariance as check_covariance, fields, finite, planar},
    follower::FollowerId,
    item::Item,
    limits::Limits,
    message::{Sender, header, message},
    pose::MAX_DISTANCE_M,
};

/// Values of [`FixHeader::status`].
pub mod fix_status {
    /// Nothing is known of the place.
    pub const LOST: u64 = 0;
    /// A first fix, without prior.
    pub const FOUND: u64 = 1;
    /// A fix near the prediction.
    pub const TRACKED: u64 = 2;
    /// A prediction by odometry from the last fix.
    pub const PREDICTED: u64 = 3;
}

message! {
    /// The place of a keyframe in the map of an earlier drive.
    Fix: "fix", FixHeader, Sender::Follower(FollowerId::Localisation), 0 readers, Latest
}
header!(FixHeader, "gyre_fix_header_v4");

/// The pose of a keyframe in the map's frame: x forward, y to the left, yaw counter-clockwise, in
/// (-pi, pi]; all zero if it is lost.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct FixHeader {
    /// `seq` counts the keyframes of the run, from 0. `scan` and the times are the keyframe's.
    pub item: Item,
    pub keyframe_seq: u64,
    /// See [`fix_status`].
    pub status: u64,
    /// The sensor's number of the map's nearest keyframe.
    pub place: u64,
    pub x_m: f64,
    pub y_m: f64,
    pub yaw_rad: f64,
    /// Covariance of (x, y, yaw) along the map's axes.
    pub covariance: covariance::Packed,
    /// Correlation with the map; 0 if it was predicted.
    pub correlation: f64,
}

impl FixHeader {
    fn check_content(&self, _: &[u8], _: &Limits) -> Result<(), Violation> {
        planar(fields![self; x_m y_m yaw_rad], MAX_DISTANCE_M)?;
        check_covariance(&self.covariance)?;
        finite(fields![self; correlation])?;
        code("status", self.status, fix_status::PREDICTED)
    }

    /// Returns the pose in the map's frame; `None` if it is lost.
    pub fn pose(&self) -> Option<PlanarPose> {
        let is_known = self.status != fix_status::LOST;
        is_known.then(|| pose(self.x_m, self.y_m, self.yaw_rad))
    }
}
