//! `pose`: where the vehicle is, and the credit that lets a new scan in.

use bytemuck::{Pod, Zeroable};
use gyre_geometry::{UncertainMotion, covariance, pose};
use iceoryx2::prelude::ZeroCopySend;

use crate::{
    FloatBlock, Item, Message, MotionEstimate,
    topic::{History, header},
};

/// The trajectory's newest pose. Its `seq` is the credit that admits scan `seq + W`.
#[derive(Debug)]
pub enum Pose {}

impl Message for Pose {
    const TOPIC: &'static str = "pose";
    // The source, masking and the supervisor.
    const READERS: usize = 3;
    const HISTORY: History = History::Feedback;
    type Header = PoseHeader;
    type Element = FloatBlock;
}
header!(PoseHeader);

/// A pose in the frame of the first scan, with the motion that led to it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable, ZeroCopySend)]
#[type_name("gyre_pose_header_v3")]
pub struct PoseHeader {
    /// Which scan this is.
    pub item: Item,
    /// The motion from the scan before.
    pub motion: MotionEstimate,
    /// Forward, m.
    pub x_m: f64,
    /// To the left, m.
    pub y_m: f64,
    /// Counter-clockwise, rad, in (-pi, pi].
    pub yaw_rad: f64,
    /// Covariance of (x, y, yaw) in the frame of the first scan: see [`covariance::Packed`].
    pub covariance: covariance::Packed,
    /// Counts corrections of the whole trajectory (loop closing); 0 as long as poses are motions composed.
    pub trajectory_version: u64,
}

impl PoseHeader {
    /// The pose with its covariance.
    pub fn pose(&self) -> UncertainMotion {
        UncertainMotion {
            motion: pose(self.x_m, self.y_m, self.yaw_rad),
            covariance: covariance::unpack(&self.covariance),
        }
    }
}
