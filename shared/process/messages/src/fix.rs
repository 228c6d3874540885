//! `fix`: the place of a keyframe in the map of an earlier drive.

use bytemuck::{Pod, Zeroable};
use gyre_geometry::{Pose as PlanarPose, covariance, pose};

use crate::{
    block::FloatBlock,
    check::{Violation, covariance as check_covariance, finite, planar, require},
    follower::FollowerId,
    item::Item,
    limits::{History, Limits},
    message::{Message, Sender, header},
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

/// The place of a keyframe in the map of an earlier drive.
#[derive(Debug)]
pub enum Fix {}

impl Message for Fix {
    const TOPIC: &'static str = "fix";
    const SENDER: Sender = Sender::Follower(FollowerId::Localisation);
    const READERS: usize = 0;
    const HISTORY: History = History::Latest;
    type Header = FixHeader;
    type Element = FloatBlock;

    fn check_content(
        header: &Self::Header,
        _: &[Self::Element],
        _: &Limits,
    ) -> Result<(), Violation> {
        header.check()
    }
}
header!(FixHeader, "gyre_fix_header_v4");

/// The pose of a keyframe in the map's frame; all zero if it is lost.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct FixHeader {
    /// `seq` counts the keyframes of the run, from 0. `scan` and the times are the keyframe's.
    pub item: Item,
    /// Number of the keyframe's scan in the run.
    pub keyframe_seq: u64,
    /// The state of the localisation: see [`fix_status`].
    pub status: u64,
    /// The sensor's number of the map's nearest keyframe.
    pub place: u64,
    /// Forward, m.
    pub x_m: f64,
    /// To the left, m.
    pub y_m: f64,
    /// Counter-clockwise, rad, in (-pi, pi].
    pub yaw_rad: f64,
    /// Covariance of (x, y, yaw) along the map's axes: see [`covariance::Packed`].
    pub covariance: covariance::Packed,
    /// Correlation with the map; 0 if it was predicted.
    pub correlation: f64,
}

impl FixHeader {
    fn check(&self) -> Result<(), Violation> {
        let place = [
            ("x_m", self.x_m),
            ("y_m", self.y_m),
            ("yaw_rad", self.yaw_rad),
        ];
        planar(place, MAX_DISTANCE_M)?;
        check_covariance(&self.covariance)?;
        finite([("correlation", self.correlation)])?;
        let known = self.status <= fix_status::PREDICTED;
        require(known, "status", self.status, "0 to 3")
    }

    /// Returns the pose in the map's frame; `None` if it is lost.
    pub fn pose(&self) -> Option<PlanarPose> {
        let is_known = self.status != fix_status::LOST;
        is_known.then(|| pose(self.x_m, self.y_m, self.yaw_rad))
    }
}
