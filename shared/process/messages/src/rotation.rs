//! `rotation`: the rotation of the vehicle between two scans.

use std::f64::consts::PI;

use bytemuck::{Pod, Zeroable};
use gyre_scan_matching::RotationMatch;

use crate::{
    check::{Violation, fields, finite, within},
    item::{Item, StageId},
    limits::Limits,
    message::{Sender, header, message},
};

message! {
    /// The rotation from the previous scan to this one.
    Rotation: "rotation", RotationHeader, Sender::Stage(&[StageId::RotationSearch]),
    1 readers, Stream
}
header!(RotationHeader, "gyre_rotation_header_v6");

/// An angle with its variance.
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
    pub(crate) fn check(&self) -> Result<(), Violation> {
        let turn = -PI..=PI;
        within("angle_rad", self.angle_rad, turn.clone())?;
        within("variance_rad2", self.variance_rad2, 0.0..=f64::MAX)?;
        within("runner_up_rad", self.runner_up_rad, turn)?;
        finite(fields![self; score runner_up_score])
    }
}

impl From<&RotationMatch> for RotationEstimate {
    fn from(found: &RotationMatch) -> Self {
        let runner_up = found.runner_up;
        Self {
            angle_rad: found.angle_rad,
            variance_rad2: found.variance_rad2,
            score: found.score,
            runner_up_rad: runner_up.map_or(0.0, |runner_up| runner_up.angle_rad),
            runner_up_score: runner_up.map_or(0.0, |runner_up| runner_up.score),
        }
    }
}

impl From<RotationEstimate> for RotationMatch {
    /// Converts without the runner-up, which no search needs.
    fn from(rotation: RotationEstimate) -> Self {
        Self {
            angle_rad: rotation.angle_rad,
            variance_rad2: rotation.variance_rad2,
            score: rotation.score,
            runner_up: None,
        }
    }
}

/// The header of `rotation`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct RotationHeader {
    pub item: Item,
    /// The rotation; all zero where the chain starts.
    pub rotation: RotationEstimate,
}

impl RotationHeader {
    fn check_content(&self, _: &[u8], _: &Limits) -> Result<(), Violation> {
        self.rotation.check()
    }
}
