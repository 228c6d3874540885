//! The objects of each scan of a run, as the follower that tracks them has found them.

use bytemuck::{Pod, Zeroable};
use gyre_contract::ListedObject;
use gyre_geometry::wrap_angle;
use gyre_objects::Object;
use gyre_slam::split;
use gyre_storage::{LogMagic, Record};
use nalgebra::{Matrix2, Point2, Vector2};

#[derive(Clone, Debug, PartialEq)]
pub struct LoggedObjects {
    /// The scan's number in the run, from 0 without gaps, which is its record's number.
    pub seq: u64,
    pub scan: u64,
    pub stamp_ns: i64,
    pub objects: Vec<Object>,
}

pub fn listed(object: &Object) -> ListedObject {
    ListedObject {
        id: object.id,
        x_m: object.position.x,
        y_m: object.position.y,
        yaw_rad: wrap_angle(object.yaw_rad),
        vx_mps: object.velocity.x,
        vy_mps: object.velocity.y,
        length_m: object.length_m,
        width_m: object.width_m,
        position_covariance: packed(&object.position_covariance),
        velocity_covariance: packed(&object.velocity_covariance),
        moving: object.moving.into(),
        age: object.age,
    }
}

/// Returns xx, xy and yy.
fn packed(matrix: &Matrix2<f64>) -> [f64; 3] {
    [matrix.m11, matrix.m12, matrix.m22]
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Fixed {
    seq: u64,
    scan: u64,
    stamp_ns: i64,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct FixedObject {
    id: u64,
    position: [f64; 2],
    velocity: [f64; 2],
    yaw_rad: f64,
    size_m: [f64; 2],
    /// xx, xy and yy.
    position_covariance: [f64; 3],
    velocity_covariance: [f64; 3],
    moving: u32,
    age: u32,
}

/// Little-endian: the fields in their order, then the objects.
impl Record for LoggedObjects {
    const FILE: &'static str = "objects.log";
    const MAGIC: LogMagic = *b"gyre objects 1 \n";

    fn encode(&self, bytes: &mut Vec<u8>) {
        let fixed = Fixed {
            seq: self.seq,
            scan: self.scan,
            stamp_ns: self.stamp_ns,
        };
        bytes.extend_from_slice(bytemuck::bytes_of(&fixed));
        for object in &self.objects {
            bytes.extend_from_slice(bytemuck::bytes_of(&FixedObject::from(object)));
        }
    }

    fn decode(bytes: &[u8]) -> Option<Self> {
        let (fixed, objects) = split::<Fixed, FixedObject>(bytes)?;
        Some(Self {
            seq: fixed.seq,
            scan: fixed.scan,
            stamp_ns: fixed.stamp_ns,
            objects: objects.map(|object| Object::from(&object)).collect(),
        })
    }
}

impl From<&Object> for FixedObject {
    fn from(object: &Object) -> Self {
        Self {
            id: object.id,
            position: [object.position.x, object.position.y],
            velocity: [object.velocity.x, object.velocity.y],
            yaw_rad: object.yaw_rad,
            size_m: [object.length_m, object.width_m],
            position_covariance: packed(&object.position_covariance),
            velocity_covariance: packed(&object.velocity_covariance),
            moving: object.moving.into(),
            age: object.age,
        }
    }
}

impl From<&FixedObject> for Object {
    fn from(fixed: &FixedObject) -> Self {
        let unpacked = |[xx, xy, yy]: [f64; 3]| Matrix2::new(xx, xy, xy, yy);
        let [length_m, width_m] = fixed.size_m;
        Self {
            id: fixed.id,
            position: Point2::from(fixed.position),
            velocity: Vector2::from(fixed.velocity),
            yaw_rad: fixed.yaw_rad,
            length_m,
            width_m,
            moving: fixed.moving != 0,
            age: fixed.age,
            position_covariance: unpacked(fixed.position_covariance),
            velocity_covariance: unpacked(fixed.velocity_covariance),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn objects_are_decoded_as_they_were_encoded() {
        let object = Object {
            id: 3,
            position: Point2::new(20.0, -4.0),
            velocity: Vector2::new(-9.0, 0.5),
            yaw_rad: 3.0,
            length_m: 4.4,
            width_m: 1.9,
            moving: true,
            age: 17,
            position_covariance: Matrix2::new(0.2, 0.01, 0.01, 0.3),
            velocity_covariance: Matrix2::new(0.5, -0.1, -0.1, 0.6),
        };
        let logged = LoggedObjects {
            seq: 4,
            scan: 9,
            stamp_ns: -5,
            objects: vec![object; 2],
        };
        let mut bytes = Vec::new();
        logged.encode(&mut bytes);
        assert_eq!(LoggedObjects::decode(&bytes).unwrap(), logged);
        assert_eq!(LoggedObjects::decode(&bytes[1..]), None);
        assert_eq!(LoggedObjects::decode(&bytes[..8]), None);
    }
}
