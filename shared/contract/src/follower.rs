//! `loop`, `correction`, `fix`, `objects`: the messages of processes that follow the logs of a run.

use bytemuck::{Pod, Zeroable};
use gyre_geometry::{Pose as PlanarPose, UncertainMotion, covariance, pose};

use crate::{
    check::{code, covariance as check_covariance, fields, finite, of, planar, require, within},
    item::{FollowerId, Item},
    limits::Limits,
    message::{Sender, header, message},
    pose::MAX_DISTANCE_M,
};

message! {
    /// An accepted loop between two keyframes.
    Loop: "loop", LoopHeader, Sender::Follower(FollowerId::LoopClosure), 0 readers, Latest
}
header!(LoopHeader, "gyre_loop_header_v4");

/// The pose of the later keyframe in the frame of the earlier one: x forward, y to the left, yaw
/// counter-clockwise, in (-pi, pi].
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct LoopHeader {
    /// `seq` counts the loops, from 0. `scan` is the later keyframe's and `previous_scan` the
    /// earlier one's.
    pub item: Item,
    pub later_seq: u64,
    pub earlier_seq: u64,
    pub x_m: f64,
    pub y_m: f64,
    pub yaw_rad: f64,
    pub covariance: covariance::Packed,
    /// Correlation of the two places where they overlap, from -1 to 1.
    pub correlation: f64,
    pub loops: u64,
}

impl LoopHeader {
    fn check_content(&self, _: &[u8], limits: &Limits) -> Result<(), String> {
        let (later, earlier) = (self.later_seq, self.earlier_seq);
        let expected = format_args!("less than {later}, the later keyframe");
        require(earlier < later, "earlier_seq", earlier, expected)?;
        planar(fields![self; x_m y_m yaw_rad], limits.extent_m())?;
        check_covariance(&self.covariance)?;
        within("correlation", self.correlation, -1.0..=1.0)?;
        require(self.loops > 0, "loops", self.loops, "1 or more")
    }

    pub fn motion(&self) -> UncertainMotion {
        UncertainMotion {
            motion: pose(self.x_m, self.y_m, self.yaw_rad),
            covariance: covariance::unpack(&self.covariance),
        }
    }
}

message! {
    /// The transform that corrects poses of the odometry. Odometry is continuous and drifts; the
    /// correction jumps when a loop is closed (REP-105: the transform from `map` to `odom`).
    Correction: "correction", CorrectionHeader, Sender::Follower(FollowerId::Trajectory),
    0 readers, Latest
}
header!(CorrectionHeader, "gyre_correction_header_v4");

/// The pose of the odometry frame in the map frame: x forward, y to the left, yaw
/// counter-clockwise, in (-pi, pi].
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct CorrectionHeader {
    /// `seq` counts the records read from the logs, from 0; their ends count as one. `scan` and the
    /// times are the newest keyframe's.
    pub item: Item,
    pub keyframe_seq: u64,
    pub keyframes: u64,
    pub loops: u64,
    pub x_m: f64,
    pub y_m: f64,
    pub yaw_rad: f64,
    /// Covariance of (x, y, yaw) of the newest keyframe's pose in the map frame, not scaled by
    /// residuals.
    pub keyframe_covariance: covariance::Packed,
}

impl CorrectionHeader {
    fn check_content(&self, _: &[u8], _: &Limits) -> Result<(), String> {
        planar(fields![self; x_m y_m yaw_rad], MAX_DISTANCE_M)?;
        check_covariance(&self.keyframe_covariance)?;
        require(self.keyframes > 0, "keyframes", self.keyframes, "1 or more")
    }

    /// Returns the transform from the odometry frame to the map frame: applied to a pose of the
    /// odometry, it gives the pose in the map.
    pub fn map_from_odometry(&self) -> PlanarPose {
        pose(self.x_m, self.y_m, self.yaw_rad)
    }
}

pub mod fix_status {
    /// Nothing is known of the place.
    pub const LOST: u64 = 0;
    /// A first fix, without prior.
    pub const FOUND: u64 = 1;
    /// A fix near the prediction.
    pub const TRACKED: u64 = 2;
    /// A prediction by odometry from the last fix.
    pub const PREDICTED: u64 = 3;
}

message! {
    Fix: "fix", FixHeader, Sender::Follower(FollowerId::Localisation), 0 readers, Latest
}
header!(FixHeader, "gyre_fix_header_v4");

/// The pose of a keyframe in the map's frame: x forward, y to the left, yaw counter-clockwise, in
/// (-pi, pi]; all zero if it is lost.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct FixHeader {
    /// `seq` counts the keyframes of the run, from 0. `scan` and the times are the keyframe's.
    pub item: Item,
    pub keyframe_seq: u64,
    /// See [`fix_status`].
    pub status: u64,
    /// The sensor's number of the map's nearest keyframe.
    pub place: u64,
    pub x_m: f64,
    pub y_m: f64,
    pub yaw_rad: f64,
    /// Covariance of (x, y, yaw) along the map's axes.
    pub covariance: covariance::Packed,
    /// Correlation with the map; 0 if it was predicted.
    pub correlation: f64,
}

impl FixHeader {
    fn check_content(&self, _: &[u8], _: &Limits) -> Result<(), String> {
        planar(fields![self; x_m y_m yaw_rad], MAX_DISTANCE_M)?;
        check_covariance(&self.covariance)?;
        finite(fields![self; correlation])?;
        code("status", self.status, fix_status::PREDICTED)
    }

    /// Returns the pose in the map's frame; `None` if it is lost.
    pub fn pose(&self) -> Option<PlanarPose> {
        let is_known = self.status != fix_status::LOST;
        is_known.then(|| pose(self.x_m, self.y_m, self.yaw_rad))
    }
}

/// Objects that a message lists, at most: those nearest to the vehicle. The others are counted, and
/// in `journal/objects.log`.
pub const MAX_LISTED: usize = 64;
const MAX_SIZE_M: f64 = 1e3;

message! {
    Objects: "objects", ObjectsHeader, Sender::Follower(FollowerId::Objects), 0 readers, Latest
}
header!(ObjectsHeader, "gyre_objects_header_v3");

/// The objects, in the odometry frame: the frame of the first scan.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct ObjectsHeader {
    /// The item of the scan's pose.
    pub item: Item,
    /// Pose of the sensor at the scan's time: x forward, y to the left, yaw counter-clockwise, in
    /// (-pi, pi].
    pub x_m: f64,
    pub y_m: f64,
    pub yaw_rad: f64,
    /// Objects that move, or did and stand now.
    pub objects: u64,
    pub moving: u64,
    pub listed: u64,
    /// The objects nearest to the vehicle, the nearest first; zero beyond `listed`.
    pub list: [ListedObject; MAX_LISTED],
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct ListedObject {
    /// The identity: counted from 1, and given to no other object of the run.
    pub id: u64,
    /// The centre, and the heading in (-pi, pi].
    pub x_m: f64,
    pub y_m: f64,
    pub yaw_rad: f64,
    /// The velocity over ground.
    pub vx_mps: f64,
    pub vy_mps: f64,
    /// Along the heading, and across it.
    pub length_m: f64,
    pub width_m: f64,
    /// Covariance of the centre: xx, xy and yy, m².
    pub position_covariance: [f64; 3],
    /// Covariance of the velocity: xx, xy and yy, (m/s)².
    pub velocity_covariance: [f64; 3],
    /// 1 if it moves, 0 if its speed is not significantly above a standing object's.
    pub moving: u32,
    /// Scans since it was first seen, that one included.
    pub age: u32,
}

impl Default for ObjectsHeader {
    fn default() -> Self {
        Self::zeroed()
    }
}

impl ObjectsHeader {
    pub fn list(&self) -> &[ListedObject] {
        &self.list[..(self.listed as usize).min(MAX_LISTED)]
    }

    fn check_content(&self, _: &[u8], _: &Limits) -> Result<(), String> {
        planar(fields![self; x_m y_m yaw_rad], MAX_DISTANCE_M)?;
        let fits = self.moving <= self.objects;
        require(fits, "moving", self.moving, "at most objects")?;
        let fits = self.listed == self.objects.min(MAX_LISTED as u64);
        let expected = format_args!("objects, at most {MAX_LISTED}");
        require(fits, "listed", self.listed, expected)?;
        let checked = self.list().iter().try_for_each(ListedObject::check);
        of("an object's ", checked)
    }
}

impl ListedObject {
    pub fn is_moving(&self) -> bool {
        self.moving != 0
    }

    pub fn speed_mps(&self) -> f64 {
        self.vx_mps.hypot(self.vy_mps)
    }

    fn check(&self) -> Result<(), String> {
        planar(fields![self; x_m y_m yaw_rad], MAX_DISTANCE_M)?;
        within("length_m", self.length_m, 0.0..=MAX_SIZE_M)?;
        within("width_m", self.width_m, 0.0..=MAX_SIZE_M)?;
        finite(fields![self; vx_mps vy_mps])?;
        let covariances = [self.position_covariance, self.velocity_covariance];
        let is_finite = covariances.as_flattened().iter().all(|it| it.is_finite());
        require(is_finite, "covariance", "not finite", "finite")
    }
}
