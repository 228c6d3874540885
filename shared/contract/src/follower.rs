//! `loop`, `correction`, `fix`: the messages of processes that follow the logs of a run with SLAM.

use gyre_geometry::{Pose as PlanarPose, UncertainMotion, covariance, pose};

use crate::{
    item::Item,
    limits::Limits,
    message::Header,
    motion::place,
    wire::{Bounds, REACH, codes, field, require, wire},
};

wire! {
    /// An accepted loop: the pose of the later keyframe in the frame of the earlier one: x forward,
    /// y to the left, yaw counter-clockwise, in (-pi, pi].
    pub struct LoopHeader = "gyre_loop_header_v4" {
        /// `seq` counts the loops, from 0. `scan` is the later keyframe's and `previous_scan` the
        /// earlier one's.
        pub item: Item,
        pub later_seq: u64,
        pub earlier_seq: u64,
        pub x_m: f64 [Bounds::Widths(1.0)],
        pub y_m: f64 [Bounds::Widths(1.0)],
        pub yaw_rad: f64 [Bounds::HalfTurn],
        pub covariance: covariance::Packed [Bounds::Covariance],
        /// Correlation of the two places where they overlap, from -1 to 1.
        pub correlation: f64 [Bounds::Within(-1.0, 1.0)],
        pub loops: u64 [Bounds::AtLeast(1)],
    }
}

impl Header for LoopHeader {
    fn check_content(&self, _: &[u8], _: &Limits) -> Result<(), String> {
        let (later, earlier) = (self.later_seq, self.earlier_seq);
        let expected = format_args!("less than {later}, the later keyframe");
        field("earlier_seq", require(earlier < later, earlier, expected))
    }

    fn words(&self, _: &[u8]) -> String {
        let place = place(self.x_m, self.y_m, self.yaw_rad);
        let (scan, correlation) = (self.item.previous_scan, self.correlation);
        format!("at scan {scan}: {place}, correlation {correlation:.3}")
    }
}

impl LoopHeader {
    pub fn motion(&self) -> UncertainMotion {
        UncertainMotion {
            motion: pose(self.x_m, self.y_m, self.yaw_rad),
            covariance: covariance::unpack(&self.covariance),
        }
    }
}

wire! {
    /// The pose of the odometry frame in the map frame: x forward, y to the left, yaw
    /// counter-clockwise, in (-pi, pi].
    pub struct CorrectionHeader = "gyre_correction_header_v4" {
        /// `seq` counts the records read from the logs, from 0; their ends count as one. `scan` and
        /// the times are the newest keyframe's.
        pub item: Item,
        pub keyframe_seq: u64,
        pub keyframes: u64 [Bounds::AtLeast(1)],
        pub loops: u64,
        pub x_m: f64 [REACH],
        pub y_m: f64 [REACH],
        pub yaw_rad: f64 [Bounds::HalfTurn],
        /// Covariance of (x, y, yaw) of the newest keyframe's pose in the map frame, not scaled by
        /// residuals.
        pub keyframe_covariance: covariance::Packed [Bounds::Covariance],
    }
}

impl Header for CorrectionHeader {
    fn words(&self, _: &[u8]) -> String {
        let place = place(self.x_m, self.y_m, self.yaw_rad);
        let (keyframes, loops) = (self.keyframes, self.loops);
        format!("{place}, {keyframes} keyframes, {loops} loops")
    }
}

impl CorrectionHeader {
    /// Returns the transform from the odometry frame to the map frame: applied to a pose of the
    /// odometry, it gives the pose in the map.
    pub fn map_from_odometry(&self) -> PlanarPose {
        pose(self.x_m, self.y_m, self.yaw_rad)
    }
}

codes! {
    pub mod fix_status: u64 {
        /// Nothing is known of the place.
        LOST = "lost",
        /// A first fix, without prior.
        FOUND = "found",
        /// A fix near the prediction.
        TRACKED = "tracked",
        /// A prediction by odometry from the last fix.
        PREDICTED = "predicted",
    }
}

wire! {
    /// The pose of a keyframe in the map's frame: x forward, y to the left, yaw counter-clockwise,
    /// in (-pi, pi]; all zero if it is lost.
    pub struct FixHeader = "gyre_fix_header_v4" {
        /// `seq` counts the keyframes of the run, from 0. `scan` and the times are the keyframe's.
        pub item: Item,
        pub keyframe_seq: u64,
        /// See [`fix_status`].
        pub status: u64 [Bounds::Codes(fix_status::NAMES)],
        /// The sensor's number of the map's nearest keyframe.
        pub place: u64,
        pub x_m: f64 [REACH],
        pub y_m: f64 [REACH],
        pub yaw_rad: f64 [Bounds::HalfTurn],
        /// Covariance of (x, y, yaw) along the map's axes.
        pub covariance: covariance::Packed [Bounds::Covariance],
        /// Correlation with the map; 0 if it was predicted.
        pub correlation: f64 [Bounds::Finite],
    }
}

impl Header for FixHeader {
    fn words(&self, _: &[u8]) -> String {
        let place = place(self.x_m, self.y_m, self.yaw_rad);
        match self.status {
            fix_status::LOST => "lost".to_owned(),
            fix_status::PREDICTED => format!("{place}, predicted"),
            _ => format!("{place}, correlation {:.3}", self.correlation),
        }
    }
}

impl FixHeader {
    /// Returns the pose in the map's frame; `None` if it is lost.
    pub fn pose(&self) -> Option<PlanarPose> {
        let is_known = self.status != fix_status::LOST;
        is_known.then(|| pose(self.x_m, self.y_m, self.yaw_rad))
    }

    /// Returns the pose if the scan was found in the map, not predicted from an earlier fix.
    pub fn measured(&self) -> Option<UncertainMotion> {
        let is_measured = [fix_status::FOUND, fix_status::TRACKED].contains(&self.status);
        let motion = self.pose().filter(|_| is_measured)?;
        Some(UncertainMotion {
            motion,
            covariance: covariance::unpack(&self.covariance),
        })
    }
}
