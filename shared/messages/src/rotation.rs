//! `rotation`: how far the vehicle turned between two scans.

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

use crate::{
    FloatBlock, Item,
    topic::{header, message},
};

message! {
    /// The rotation of this scan against the one before.
    Rotation, "rotation", RotationHeader, FloatBlock
}
header!(RotationHeader);

/// An angle and how much to trust it.
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
