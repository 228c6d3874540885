//! `rotation`: the rotation of the vehicle between two scans.

use bytemuck::{Pod, Zeroable};
use gyre_scan_matching::RotationMatch;
use iceoryx2::prelude::ZeroCopySend;

use crate::{
    block::FloatBlock,
    item::Item,
    limits::History,
    message::{Message, header},
};

/// The rotation from the previous scan to this one.
#[derive(Debug)]
pub enum Rotation {}

impl Message for Rotation {
    const TOPIC: &'static str = "rotation";
    const READERS: usize = 1;
    const HISTORY: History = History::Stream;
    type Header = RotationHeader;
    type Element = FloatBlock;
}
header!(RotationHeader);

/// An angle with its variance.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[type_name("gyre_rotation_estimate_v1")]
pub struct RotationEstimate {
    /// Yaw of this scan's frame in the previous scan's frame, rad, counter-clockwise.
    pub angle_rad: f64,
    /// Variance from the shape of the peak, rad^2.
    pub variance_rad2: f64,
    /// Height of the correlation peak, at most 1.
    pub score: f64,
    /// Angle of the second highest peak, rad.
    pub runner_up_rad: f64,
    /// Height of the second highest peak.
    pub runner_up_score: f64,
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
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable, ZeroCopySend)]
#[type_name("gyre_rotation_header_v3")]
pub struct RotationHeader {
    /// The scan.
    pub item: Item,
    /// The rotation; all zero where the chain starts.
    pub rotation: RotationEstimate,
}
