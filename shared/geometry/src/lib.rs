//! The types that all parts share: poses, twists and covariances in SE(2), points, polar scans, and
//! samples of other sensors.
//!
//! # Frames and units
//! Frames follow REP-103: x forward, y left, yaw counter-clockwise. Lengths are in m, angles in
//! rad, times in s. A motion is the pose of the later frame in the earlier frame. Composition is
//! `first * then`.

mod bounds;
mod chain;
mod composed_motion;
pub mod covariance;
mod lost;
mod named;
mod point;
mod pose;
pub mod samples;
pub mod scan;
mod twist;

pub use bounds::{Bounds, SettingError, check};
pub use chain::{MAX_INTERVAL_NS, continues};
pub use composed_motion::{ComposedMotion, OdometryMotion};
pub use covariance::UncertainMotion;
pub use lost::{LostAzimuths, MAX_GAPS, MAX_SINGLE};
pub use point::SparsePoint;
pub use pose::{Pose, interpolate, mirrored, pose, wrap_angle, xy_yaw};
pub use scan::{
    MAX_AZIMUTHS, OwnedScan, PolarScan, ScanError, ScanLimits, ScanSlot, Sense, SweepGeometry,
};
pub use twist::Twist;
