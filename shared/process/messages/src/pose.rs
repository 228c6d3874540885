//! `pose`: the pose of the vehicle, which is also the credit that admits a new scan.

use bytemuck::{Pod, Zeroable};
use gyre_geometry::{ComposedMotion, UncertainMotion, covariance, pose};

use crate::{
    block::FloatBlock,
    check::{Violation, covariance as check_covariance, planar},
    item::{Item, StageId},
    limits::{History, Limits},
    message::{Message, Sender, header},
    motion::MotionEstimate,
};

/// The newest pose of the trajectory. Pose `seq` is the credit that admits scan `seq + W`.
#[derive(Debug)]
pub enum Pose {}

impl Message for Pose {
    const TOPIC: &'static str = "pose";
    const SENDER: Sender = Sender::Stage(&[StageId::PoseIntegration]);
    // The source, masking and the supervisor.
    const READERS: usize = 3;
    const HISTORY: History = History::Feedback;
    type Header = PoseHeader;
    type Element = FloatBlock;

    fn check_content(
        header: &Self::Header,
        _: &[Self::Element],
        limits: &Limits,
    ) -> Result<(), Violation> {
        header.check(limits)
    }
}
header!(PoseHeader, "gyre_pose_header_v11");

/// A pose in the frame of the first scan, with the motion that led to it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct PoseHeader {
    pub item: Item,
    /// The motion from the previous scan.
    pub motion: MotionEstimate,
    /// Forward, m.
    pub x_m: f64,
    /// To the left, m.
    pub y_m: f64,
    /// Counter-clockwise, rad, in (-pi, pi].
    pub yaw_rad: f64,
    /// Covariance of (x, y, yaw) in the frame of the first scan: see [`covariance::Packed`].
    pub covariance: covariance::Packed,
    /// The part of it that later poses have too, equal to it where the errors of motions are
    /// independent: see [`ComposedMotion::accumulated`].
    pub accumulated_covariance: covariance::Packed,
    /// Number of corrections of the whole trajectory (loop closures); always 0 while poses are only
    /// composed motions.
    pub trajectory_version: u64,
}

/// Farthest pose from the first one, m: more than a way around the earth.
pub(crate) const MAX_DISTANCE_M: f64 = 1e8;

impl PoseHeader {
    fn check(&self, limits: &Limits) -> Result<(), Violation> {
        let pose = [
            ("x_m", self.x_m),
            ("y_m", self.y_m),
            ("yaw_rad", self.yaw_rad),
        ];
        planar(pose, MAX_DISTANCE_M)?;
        check_covariance(&self.covariance)?;
        check_covariance(&self.accumulated_covariance)?;
        self.motion.check(limits)
    }

    /// Returns the pose with its covariance.
    pub fn pose(&self) -> UncertainMotion {
        UncertainMotion {
            motion: pose(self.x_m, self.y_m, self.yaw_rad),
            covariance: covariance::unpack(&self.covariance),
        }
    }

    /// Returns the motion from the first scan to this one, to compose it with the next.
    pub fn composed(&self) -> ComposedMotion {
        ComposedMotion::resume(
            self.pose(),
            covariance::unpack(&self.accumulated_covariance),
        )
    }
}
