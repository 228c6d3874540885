//! `loop`, `correction`, `fix`, `objects`: the messages of processes that follow the logs of a run.

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
}

/// Objects that a message lists, at most: those nearest to the vehicle. The others are counted, and
/// in `journal/objects.log`.
pub const MAX_LISTED: usize = 64;
const SIZE: Bounds = Bounds::Within(0.0, 1e3);

wire! {
    /// The objects, in the odometry frame: the frame of the first scan.
    pub struct ObjectsHeader = "gyre_objects_header_v3" {
        /// The item of the scan's pose.
        pub item: Item,
        /// Pose of the sensor at the scan's time: x forward, y to the left, yaw counter-clockwise,
        /// in (-pi, pi].
        pub x_m: f64 [REACH],
        pub y_m: f64 [REACH],
        pub yaw_rad: f64 [Bounds::HalfTurn],
        /// Objects that move, or did and stand now.
        pub objects: u64,
        pub moving: u64,
        pub listed: u64,
        /// The objects nearest to the vehicle, the nearest first; zero beyond `listed`.
        pub list: [ListedObject; MAX_LISTED] [Bounds::CountedBy("listed")],
    }

    pub struct ListedObject = "gyre_listed_object_v1" {
        /// The identity: counted from 1, and given to no other object of the run.
        pub id: u64,
        /// The centre, and the heading in (-pi, pi].
        pub x_m: f64 [REACH],
        pub y_m: f64 [REACH],
        pub yaw_rad: f64 [Bounds::HalfTurn],
        /// The velocity over ground.
        pub vx_mps: f64 [Bounds::Finite],
        pub vy_mps: f64 [Bounds::Finite],
        /// Along the heading, and across it.
        pub length_m: f64 [SIZE],
        pub width_m: f64 [SIZE],
        /// Covariance of the centre: xx, xy and yy, m².
        pub position_covariance: [f64; 3] [Bounds::Finite],
        /// Covariance of the velocity: xx, xy and yy, (m/s)².
        pub velocity_covariance: [f64; 3] [Bounds::Finite],
        /// 1 if it moves, 0 if its speed is not significantly above a standing object's.
        pub moving: u32,
        /// Scans since it was first seen, that one included.
        pub age: u32,
    }
}

impl Header for ObjectsHeader {
    fn check_content(&self, _: &[u8], _: &Limits) -> Result<(), String> {
        let fits = self.moving <= self.objects;
        field("moving", require(fits, self.moving, "at most objects"))?;
        let fits = self.listed == self.objects.min(MAX_LISTED as u64);
        let expected = format_args!("objects, at most {MAX_LISTED}");
        field("listed", require(fits, self.listed, expected))
    }

    fn words(&self, _: &[u8]) -> String {
        let mut text = format!("{} objects, {} move", self.objects, self.moving);
        for object in self.list().iter().filter(|object| object.is_moving()) {
            let place = place(object.x_m, object.y_m, object.yaw_rad);
            let (id, speed_mps) = (object.id, object.speed_mps());
            text += &format!("; {id}: {place}, {speed_mps:.1} m/s");
        }
        text
    }
}

impl ObjectsHeader {
    pub fn list(&self) -> &[ListedObject] {
        &self.list[..(self.listed as usize).min(MAX_LISTED)]
    }
}

impl ListedObject {
    pub fn is_moving(&self) -> bool {
        self.moving != 0
    }

    pub fn speed_mps(&self) -> f64 {
        self.vx_mps.hypot(self.vy_mps)
    }
}
