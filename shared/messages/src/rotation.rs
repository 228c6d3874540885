//! `rotation`: by how much the vehicle turned between two scans.

use bytemuck::{Pod, Zeroable};
use gyre_scan_matching::RotationMatch;
use iceoryx2::prelude::ZeroCopySend;

use crate::{
    FloatBlock, Item, Message,
    topic::{History, header},
};

/// The rotation of this scan against the one before.
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
    /// Yaw of this scan's frame in the frame of the scan before, rad, counter-clockwise.
    pub angle_rad: f64,
    /// Its variance, rad^2, from the shape of the peak.
    pub variance_rad2: f64,
    /// Height of the peak, at most 1.
    pub score: f64,
    /// The next best angle, rad.
    pub runner_up_rad: f64,
    /// Its height.
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
    /// The runner-up is left out: no search needs it.
    fn from(rotation: RotationEstimate) -> Self {
        Self {
            angle_rad: rotation.angle_rad,
            variance_rad2: rotation.variance_rad2,
            score: rotation.score,
            runner_up: None,
        }
    }
}

/// See [`RotationEstimate`].
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable, ZeroCopySend)]
#[type_name("gyre_rotation_header_v3")]
pub struct RotationHeader {
    /// Which scan this is.
    pub item: Item,
    /// All zero where the chain starts.
    pub rotation: RotationEstimate,
}
