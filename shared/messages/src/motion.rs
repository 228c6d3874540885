//! `motion`: how the vehicle moved between two scans.

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

use crate::{
    FloatBlock, Item, Refinement, RotationEstimate,
    topic::{header, message},
};

message! {
    /// The motion from the scan before to this one.
    Motion, "motion", MotionHeader, FloatBlock
}
header!(MotionHeader);

/// The pose of this scan's frame in the frame of the scan before, and how much to trust it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[type_name("gyre_motion_estimate_v2")]
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
    /// The motion as the search found it: x, y (m), yaw (rad). Masking undoes the sweep with it, so it is the same on every topic.
    pub searched: [f64; 3],
    /// How the refinement changed that.
    pub refinement: Refinement,
}

/// What masking learns of a motion: the same whether it hears it on `motion` or, refined, with its pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SearchedMotion {
    /// Forward, m.
    pub x_m: f64,
    /// To the left, m.
    pub y_m: f64,
    /// Counter-clockwise, rad.
    pub yaw_rad: f64,
    /// Time between the two scans, ns on the sensor's clock.
    pub interval_ns: i64,
}

impl MotionEstimate {
    /// The motion as the search found it.
    pub fn as_searched(&self) -> SearchedMotion {
        let [x_m, y_m, yaw_rad] = self.searched;
        SearchedMotion {
            x_m,
            y_m,
            yaw_rad,
            interval_ns: self.interval_ns,
        }
    }
}

/// See [`MotionEstimate`].
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable, ZeroCopySend)]
#[type_name("gyre_motion_header_v3")]
pub struct MotionHeader {
    /// Which scan this is.
    pub item: Item,
    /// All zero where the chain starts.
    pub motion: MotionEstimate,
}
