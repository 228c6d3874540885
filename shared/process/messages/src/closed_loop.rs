//! `loop`: a place that the vehicle has come back to.

use bytemuck::{Pod, Zeroable};
use gyre_geometry::{UncertainMotion, covariance, pose};

use crate::{
    block::FloatBlock,
    check::{Violation, covariance as check_covariance, planar, require, within},
    follower::FollowerId,
    item::Item,
    limits::{History, Limits},
    message::{Message, Sender, header},
};

/// An accepted loop between two keyframes.
#[derive(Debug)]
pub enum Loop {}

impl Message for Loop {
    const TOPIC: &'static str = "loop";
    const SENDER: Sender = Sender::Follower(FollowerId::LoopClosure);
    const READERS: usize = 0;
    const HISTORY: History = History::Latest;
    type Header = LoopHeader;
    type Element = FloatBlock;

    fn check_content(
        header: &Self::Header,
        _: &[Self::Element],
        limits: &Limits,
    ) -> Result<(), Violation> {
        header.check(limits)
    }
}
header!(LoopHeader, "gyre_loop_header_v4");

/// The pose of the later keyframe in the frame of the earlier one.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct LoopHeader {
    /// `seq` counts the loops, from 0. `scan` is the later keyframe's and `previous_scan` the
    /// earlier one's.
    pub item: Item,
    /// Number of the later keyframe's scan in the run.
    pub later_seq: u64,
    /// Number of the earlier keyframe's scan in the run.
    pub earlier_seq: u64,
    /// Forward, m.
    pub x_m: f64,
    /// To the left, m.
    pub y_m: f64,
    /// Counter-clockwise, rad, in (-pi, pi].
    pub yaw_rad: f64,
    /// Covariance of (x, y, yaw): see [`covariance::Packed`].
    pub covariance: covariance::Packed,
    /// Correlation of the two places where they overlap, from -1 to 1.
    pub correlation: f64,
    /// Number of loops so far, with this one.
    pub loops: u64,
}

impl LoopHeader {
    fn check(&self, limits: &Limits) -> Result<(), Violation> {
        let earlier = self.earlier_seq;
        require(
            earlier < self.later_seq,
            "earlier_seq",
            earlier,
            format_args!("less than {}, the later keyframe", self.later_seq),
        )?;
        let motion = [
            ("x_m", self.x_m),
            ("y_m", self.y_m),
            ("yaw_rad", self.yaw_rad),
        ];
        planar(motion, limits.extent_m())?;
        check_covariance(&self.covariance)?;
        within("correlation", self.correlation, -1.0..=1.0)?;
        require(self.loops > 0, "loops", self.loops, "1 or more")
    }

    /// Returns the pose of the later keyframe in the frame of the earlier one, with its covariance.
    pub fn motion(&self) -> UncertainMotion {
        UncertainMotion {
            motion: pose(self.x_m, self.y_m, self.yaw_rad),
            covariance: covariance::unpack(&self.covariance),
        }
    }
}
