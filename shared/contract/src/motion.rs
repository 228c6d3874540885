//! `rotation`, `motion` and `refined`: the motion of the vehicle between two scans.

use std::f64::consts::PI;

use bytemuck::{Pod, Zeroable};
use gyre_geometry::{MAX_INTERVAL_NS, OdometryMotion, Twist, covariance, pose};

use crate::{
    check::{covariance as check_covariance, fields, finite, planar, require, within},
    item::{Item, StageId},
    limits::Limits,
    message::{Sender, header, message},
    refinement::RefinementRecord,
};

message! {
    /// The rotation from the previous scan to this one.
    Rotation: "rotation", RotationHeader, Sender::Stage(&[StageId::RotationSearch]),
    1 readers, Stream
}
header!(RotationHeader, "gyre_rotation_header_v6");

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct RotationEstimate {
    /// Yaw of this scan's frame in the previous scan's frame, rad, counter-clockwise.
    pub angle_rad: f64,
    /// Variance from the shape of the peak, rad^2.
    pub variance_rad2: f64,
    /// Height of the correlation peak, at most 1.
    pub score: f64,
    /// Angle, rad, and height of the second highest peak.
    pub runner_up_rad: f64,
    pub runner_up_score: f64,
}

impl RotationEstimate {
    pub(crate) fn check(&self) -> Result<(), String> {
        let turn = -PI..=PI;
        within("angle_rad", self.angle_rad, turn.clone())?;
        within("variance_rad2", self.variance_rad2, 0.0..=f64::MAX)?;
        within("runner_up_rad", self.runner_up_rad, turn)?;
        finite(fields![self; score runner_up_score])
    }
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct RotationHeader {
    pub item: Item,
    /// The rotation; all zero where the chain starts.
    pub rotation: RotationEstimate,
}

impl RotationHeader {
    fn check_content(&self, _: &[u8], _: &Limits) -> Result<(), String> {
        self.rotation.check()
    }
}

message! {
    /// The motion from the previous scan to this one. Masking reads it, and the next stage in the
    /// stream.
    Motion: "motion", MotionHeader,
    Sender::Stage(&[StageId::TranslationSearch, StageId::JointSearch]), 2 readers, Feedback
}
header!(MotionHeader, "gyre_motion_header_v11");

/// The pose of this scan's frame in the previous scan's frame, with its covariance: x forward, y to
/// the left, yaw counter-clockwise.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct MotionEstimate {
    pub x_m: f64,
    pub y_m: f64,
    pub yaw_rad: f64,
    pub covariance: covariance::Packed,
    /// Share of the covariance that is drift, 0 to 1: see [`OdometryMotion::drift_share`].
    pub drift_share: f64,
    /// Standard deviation of the scale that all motions share: see [`OdometryMotion::scale_sigma`].
    pub scale_sigma: f64,
    /// Time between the two scans, ns on the sensor's clock.
    pub interval_ns: i64,
    /// Height of the correlation peak of the translation, at most 1.
    pub score: f64,
    pub runner_up_score: f64,
    pub rotation: RotationEstimate,
    /// The searched motion: x, y (m), yaw (rad). It is the same on every topic, because motion
    /// compensation uses it.
    pub searched: [f64; 3],
    pub refinement: RefinementRecord,
}

/// Longest motion in widths of a raster. The search stays within one; a prediction over a gap may
/// be longer.
const MAX_EXTENTS: f64 = 10.0;

impl MotionEstimate {
    pub(crate) fn check(&self, limits: &Limits) -> Result<(), String> {
        let motion = fields![self; x_m y_m yaw_rad];
        planar(motion, MAX_EXTENTS * limits.extent_m())?;
        let [x_m, y_m, yaw_rad] = self.searched;
        let searched = [
            ("searched[0]", x_m),
            ("searched[1]", y_m),
            ("searched[2]", yaw_rad),
        ];
        planar(searched, limits.extent_m())?;
        check_covariance(&self.covariance)?;
        within("drift_share", self.drift_share, 0.0..=1.0)?;
        within("scale_sigma", self.scale_sigma, 0.0..=1.0)?;
        let interval_ns = self.interval_ns;
        let holds = (0..=MAX_INTERVAL_NS).contains(&interval_ns);
        let expected = format_args!("from 0 to {MAX_INTERVAL_NS}");
        require(holds, "interval_ns", interval_ns, expected)?;
        finite(fields![self; score runner_up_score])?;
        self.rotation.check()?;
        self.refinement.check()
    }

    pub fn motion(&self) -> OdometryMotion {
        OdometryMotion {
            motion: pose(self.x_m, self.y_m, self.yaw_rad),
            covariance: covariance::unpack(&self.covariance),
            drift_share: self.drift_share,
            scale_sigma: self.scale_sigma,
        }
    }

    /// Returns the constant velocity of the searched motion. It is the same whether masking reads
    /// it from `motion` or from `pose` after refinement.
    pub fn searched_twist(&self) -> Twist {
        let [x_m, y_m, yaw_rad] = self.searched;
        let interval_s = self.interval_ns as f64 * 1e-9;
        Twist::from_motion(&pose(x_m, y_m, yaw_rad), interval_s)
    }
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct MotionHeader {
    pub item: Item,
    /// The motion; all zero where the chain starts.
    pub motion: MotionEstimate,
}

impl MotionHeader {
    fn check_content(&self, _: &[u8], limits: &Limits) -> Result<(), String> {
        self.motion.check(limits)
    }
}

message! {
    /// As [`Motion`], in runs with refinement. The searched motion stays beside the
    /// refined one.
    Refined: "refined", MotionHeader, Sender::Stage(&[StageId::Refinement]), 1 readers, Feedback
}
