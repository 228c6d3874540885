//! `loop`: a place that the vehicle has come back to.

use bytemuck::{Pod, Zeroable};
use gyre_geometry::{UncertainMotion, covariance, pose};

use crate::{
    check::{Violation, covariance as check_covariance, fields, planar, require, within},
    follower::FollowerId,
    item::Item,
    limits::Limits,
    message::{Sender, header, message},
};

message! {
    /// An accepted loop between two keyframes.
    Loop: "loop", LoopHeader, Sender::Follower(FollowerId::LoopClosure), 0 readers, Latest
}
header!(LoopHeader, "gyre_loop_header_v4");

/// The pose of the later keyframe in the frame of the earlier one: x forward, y to the left, yaw
/// counter-clockwise, in (-pi, pi].
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct LoopHeader {
    /// `seq` counts the loops, from 0. `scan` is the later keyframe's and `previous_scan` the
    /// earlier one's.
    pub item: Item,
    pub later_seq: u64,
    pub earlier_seq: u64,
    pub x_m: f64,
    pub y_m: f64,
    pub yaw_rad: f64,
    pub covariance: covariance::Packed,
    /// Correlation of the two places where they overlap, from -1 to 1.
    pub correlation: f64,
    /// Number of loops so far, with this one.
    pub loops: u64,
}

impl LoopHeader {
    fn check_content(&self, _: &[u8], limits: &Limits) -> Result<(), Violation> {
        let (later, earlier) = (self.later_seq, self.earlier_seq);
        let expected = format_args!("less than {later}, the later keyframe");
        require(earlier < later, "earlier_seq", earlier, expected)?;
        planar(fields![self; x_m y_m yaw_rad], limits.extent_m())?;
        check_covariance(&self.covariance)?;
        within("correlation", self.correlation, -1.0..=1.0)?;
        require(self.loops > 0, "loops", self.loops, "1 or more")
    }

    pub fn motion(&self) -> UncertainMotion {
        UncertainMotion {
            motion: pose(self.x_m, self.y_m, self.yaw_rad),
            covariance: covariance::unpack(&self.covariance),
        }
    }
}
