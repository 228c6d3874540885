//! Tracked objects as detections, and as shapes that viewers draw.
//!
//! Both are in the frame `odom`: the vehicle's frame at the first scan. Gyre's objects are in the
//! radar's frame, so they are moved and turned by the [`Mounting`].

use gyre_contract::{Drawing, Object};
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

/// Returns the objects of a scan as detections of the class `moving` or `standing`.
///
/// The covariance of a pose is the covariance of the centre along the axes of `odom`. The heading
/// has none in Gyre, and z, roll and pitch are not measured: their variance is [`frames::UNKNOWN`].
/// Boxes have no height, for the same reason.
pub fn detections(stamp_ns: i64, vehicle: &Vehicle, objects: &[Object]) -> Detection3DArray {
    let mounting = &vehicle.mounting;
    let header = Header::new(stamp_ns, &vehicle.frames.odom);
    let detection = |object: &Object| {
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
        let size = Vector3::new(object.length_m, object.width_m, 0.0);
        Detection3D {
            header: header.clone(),
            results: vec![result],
            bbox: BoundingBox3D { center: pose, size },
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
pub fn markers(stamp_ns: i64, vehicle: &Vehicle, objects: &[Object]) -> MarkerArray {
    let mounting = &vehicle.mounting;
    let header = Header::new(stamp_ns, &vehicle.frames.odom);
    let mut markers = vec![Marker {
        header: header.clone(),
        action: DELETEALL,
        ..Marker::default()
    }];
    for (object, id) in objects.iter().zip(0..) {
        let Drawing {
            sides_m: [length_m, width_m, height_m],
            colour: [r, g, b],
            label,
            arrow_m,
        } = object.drawing();
        let [r, g, b] = [r, g, b].map(|part| part as f32);
        // The action is `ADD`, the default.
        let shape = |ns: &str, r#type, pose, scale, opacity| Marker {
            header: header.clone(),
            ns: ns.to_owned(),
            id,
            r#type,
            pose,
            scale,
            color: ColorRGBA {
                r,
                g,
                b,
                a: opacity,
            },
            ..Marker::default()
        };
        let place = place(mounting, object);
        let middle = lifted(&place, 0.5 * height_m);
        let sides = Vector3::new(length_m, width_m, height_m);
        markers.push(shape("boxes", CUBE, middle, sides, Drawing::OPACITY as f32));
        let above = lifted(&place, height_m + Drawing::LETTER_M);
        let letter = Vector3::new(0.0, 0.0, Drawing::LETTER_M);
        markers.push(Marker {
            text: label,
            ..shape("identities", TEXT_VIEW_FACING, above, letter, 1.0)
        });
        if let Some(arrow_m) = arrow_m {
            let at = place.translation.vector;
            let velocity = mounting.radar().rotation * Vector2::new(object.vx_mps, object.vy_mps);
            let ahead = planar(at.x, at.y, velocity.y.atan2(velocity.x));
            let sides = Vector3::new(arrow_m, Drawing::ARROW_M, Drawing::ARROW_M);
            markers.push(shape(
                "velocities",
                ARROW,
                lifted(&ahead, height_m),
                sides,
                1.0,
            ));
        }
    }
    MarkerArray { markers }
}

/// Returns the centre and the heading of an object in the vehicle's frame at the first scan.
fn place(mounting: &Mounting, object: &Object) -> Pose {
    mounting.radar() * planar(object.x_m, object.y_m, object.yaw_rad)
}

fn lifted(place: &Pose, height_m: f64) -> geometry_msgs::Pose {
    let mut pose = frames::pose(place);
    pose.position.z = height_m;
    pose
}

/// Returns the covariance of the centre, turned by the mounting.
fn covariance(mounting: &Mounting, object: &Object) -> Covariance {
    let [xx, xy, yy] = object.position_covariance;
    let turn = mounting.radar().rotation.to_rotation_matrix();
    let turned = turn * Matrix2::new(xx, xy, xy, yy) * turn.transpose();
    let mut covariance = frames::covariance(None);
    for (row, column) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        covariance.set(row, column, turned[(row, column)]);
    }
    covariance
}
