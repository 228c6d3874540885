//! `objects`: what moves around the vehicle.

use bytemuck::{Pod, Zeroable};

use crate::{
    check::{Violation, fields, finite, of, planar, require, within},
    follower::FollowerId,
    item::Item,
    limits::Limits,
    message::{Sender, header, message},
    pose::MAX_DISTANCE_M,
};

/// Objects that a message lists, at most: those nearest to the vehicle. The others are counted, and
/// in `journal/objects.log`.
pub const MAX_LISTED: usize = 64;
/// Largest length and width of an object, m.
const MAX_SIZE_M: f64 = 1e3;

message! {
    /// The objects at the time of a scan.
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

/// An object at the time of a scan.
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

    fn check_content(&self, _: &[u8], _: &Limits) -> Result<(), Violation> {
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

    fn check(&self) -> Result<(), Violation> {
        planar(fields![self; x_m y_m yaw_rad], MAX_DISTANCE_M)?;
        within("length_m", self.length_m, 0.0..=MAX_SIZE_M)?;
        within("width_m", self.width_m, 0.0..=MAX_SIZE_M)?;
        finite(fields![self; vx_mps vy_mps])?;
        let covariances = [self.position_covariance, self.velocity_covariance];
        let is_finite = covariances.as_flattened().iter().all(|it| it.is_finite());
        require(is_finite, "covariance", "not finite", "finite")
    }
}
