//! `motion`: how the vehicle moved between two scans.

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

use crate::{FloatBlock, Item, RotationEstimate, topic::message};

message! {
    /// The motion from the scan before to this one.
    Motion, "motion", MotionHeader, FloatBlock
}

/// The pose of this scan's frame in the frame of the scan before, and how much to trust it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[type_name("gyre_motion_estimate_v1")]
pub struct MotionEstimate {
    /// Forward, m.
    pub x_m: f64,
    /// To the left, m.
    pub y_m: f64,
    /// Counter-clockwise, rad.
    pub yaw_rad: f64,
    /// Covariance of (x, y, yaw), the upper triangle by rows: xx, xy, x yaw, yy, y yaw, yaw yaw.
    pub covariance: [f64; 6],
    /// Time between the two scans, ns on the sensor's clock.
    pub interval_ns: i64,
    /// Height of the translation's peak, at most 1.
    pub score: f64,
    /// Height of the next best peak.
    pub runner_up_score: f64,
    /// The rotation that the translation was searched with.
    pub rotation: RotationEstimate,
}

/// See [`MotionEstimate`].
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable, ZeroCopySend)]
#[type_name("gyre_motion_header_v2")]
pub struct MotionHeader {
    /// Which scan this is.
    pub item: Item,
    /// All zero where the chain starts.
    pub motion: MotionEstimate,
}
