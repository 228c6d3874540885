//! Tracked objects as detections, and as shapes that viewers draw.
//!
//! Both are in the frame `odom`: the vehicle's frame at the first scan. Gyre's objects are in the
//! radar's frame, so they are moved and turned by the [`Mounting`].

use gyre_contract::ListedObject;
use gyre_geometry::{Pose, pose as planar};
use nalgebra::{Matrix2, Vector2};

use crate::{
    Mounting, Vehicle, frames,
    geometry_msgs::{self, Covariance, PoseWithCovariance, Vector3},
    std_msgs::{ColorRGBA, Header},
    vision_msgs::{
        BoundingBox3D, Detection3D, Detection3DArray, ObjectHypothesis, ObjectHypothesisWithPose,
    },
    visualization_msgs::{ARROW, CUBE, DELETEALL, Marker, MarkerArray, TEXT_VIEW_FACING},
};

const MOVING: &str = "moving";
/// The class of an object that moved, and stands now.
const STANDING: &str = "standing";

/// Height for drawing objects, m: a radar in the plane does not measure it.
const DRAWN_HEIGHT_M: f64 = 1.6;
/// Diameter of an arrow's head, m.
const ARROW_M: f64 = 0.9;
/// Height of a letter, m.
const LETTER_M: f64 = 1.2;

/// Returns the objects of a scan as detections of the class `moving` or `standing`.
///
/// The covariance of a pose is the covariance of the centre along the axes of `odom`. The heading
/// has none in Gyre, and z, roll and pitch are not measured: their variance is [`frames::UNKNOWN`].
/// Boxes have no height, for the same reason.
pub fn detections(stamp_ns: i64, vehicle: &Vehicle, objects: &[ListedObject]) -> Detection3DArray {
    let mounting = &vehicle.mounting;
    let header = Header::new(stamp_ns, &vehicle.frames.odom);
    let detection = |object: &ListedObject| {
        let pose = frames::pose(&place(mounting, object));
        let class_id = if object.is_moving() { MOVING } else { STANDING };
        let covariance = covariance(mounting, object);
        let result = ObjectHypothesisWithPose {
            hypothesis: ObjectHypothesis {
                class_id: class_id.to_owned(),
                score: 1.0,
            },
            pose: PoseWithCovariance { pose, covariance },
        };
        let (center, size) = (pose, size(object, 0.0));
        Detection3D {
            header: header.clone(),
            results: vec![result],
            bbox: BoundingBox3D { center, size },
            id: object.id.to_string(),
        }
    };
    Detection3DArray {
        detections: objects.iter().map(detection).collect(),
        header: header.clone(),
    }
}

/// Returns the objects of a scan as shapes: a box of 1.6 m height, the displacement of a second as
/// an arrow if the object moves, and the identity as a text. The shapes of the scan before are
/// removed.
pub fn markers(stamp_ns: i64, vehicle: &Vehicle, objects: &[ListedObject]) -> MarkerArray {
    let mounting = &vehicle.mounting;
    let header = Header::new(stamp_ns, &vehicle.frames.odom);
    let mut markers = vec![Marker {
        header: header.clone(),
        action: DELETEALL,
        ..Marker::default()
    }];
    for (object, id) in objects.iter().zip(0..) {
        // The action is `ADD`, the default.
        let shape = |ns: &str, r#type, pose, scale, opacity| Marker {
            header: header.clone(),
            ns: ns.to_owned(),
            id,
            r#type,
            pose,
            scale,
            color: colour(object, opacity),
            ..Marker::default()
        };
        let place = place(mounting, object);
        let middle = lifted(&place, 0.5 * DRAWN_HEIGHT_M);
        let sides = size(object, DRAWN_HEIGHT_M);
        markers.push(shape("boxes", CUBE, middle, sides, 0.5));
        let above = lifted(&place, DRAWN_HEIGHT_M + LETTER_M);
        let letter = Vector3::new(0.0, 0.0, LETTER_M);
        markers.push(Marker {
            text: object.id.to_string(),
            ..shape("identities", TEXT_VIEW_FACING, above, letter, 1.0)
        });
        if object.is_moving() {
            let at = place.translation.vector;
            let velocity = mounting.radar().rotation * Vector2::new(object.vx_mps, object.vy_mps);
            let ahead = planar(at.x, at.y, velocity.y.atan2(velocity.x));
            let (ahead, length) = (lifted(&ahead, DRAWN_HEIGHT_M), object.speed_mps());
            let sides = Vector3::new(length, ARROW_M, ARROW_M);
            markers.push(shape("velocities", ARROW, ahead, sides, 1.0));
        }
    }
    MarkerArray { markers }
}

/// Orange if it moves, grey if it stands, as in Gyre's own views.
fn colour(object: &ListedObject, a: f32) -> ColorRGBA {
    let [r, g, b] = match object.is_moving() {
        true => [1.0, 0.55, 0.1],
        false => [0.6, 0.65, 0.7],
    };
    ColorRGBA { r, g, b, a }
}

/// Returns the centre and the heading of an object in the vehicle's frame at the first scan.
fn place(mounting: &Mounting, object: &ListedObject) -> Pose {
    mounting.radar() * planar(object.x_m, object.y_m, object.yaw_rad)
}

fn lifted(place: &Pose, height_m: f64) -> geometry_msgs::Pose {
    let mut pose = frames::pose(place);
    pose.position.z = height_m;
    pose
}

fn size(object: &ListedObject, height_m: f64) -> Vector3 {
    Vector3::new(object.length_m, object.width_m, height_m)
}

/// Returns the covariance of the centre, turned by the mounting.
fn covariance(mounting: &Mounting, object: &ListedObject) -> Covariance {
    let [xx, xy, yy] = object.position_covariance;
    let turn = mounting.radar().rotation.to_rotation_matrix();
    let turned = turn * Matrix2::new(xx, xy, xy, yy) * turn.transpose();
    let mut covariance = frames::covariance(None);
    for (row, column) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        covariance.set(row, column, turned[(row, column)]);
    }
    covariance
}
