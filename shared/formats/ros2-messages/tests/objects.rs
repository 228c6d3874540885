//! Objects of Gyre as detections and markers.

use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2, PI};

use gyre_contract::Object;
use gyre_ros2_messages::{
    Vehicle,
    frames::UNKNOWN,
    geometry_msgs::Pose,
    objects::{detections, markers},
    vision_msgs::Detection3D,
    visualization_msgs::{ARROW, CUBE, DELETEALL, Marker, TEXT_VIEW_FACING},
};

const STAMP_NS: i64 = 1_549_986_608_000_000_007;

/// A car that drives to the right, 20 m ahead and 3 m to the left, and one that stands.
fn objects() -> [Object; 2] {
    let car = Object {
        id: 17,
        x_m: 20.0,
        y_m: 3.0,
        yaw_rad: -FRAC_PI_2,
        vy_mps: -9.0,
        length_m: 4.5,
        width_m: 1.75,
        position_covariance: [0.25, 0.125, 0.75],
        moving: 1,
        ..Object::default()
    };
    let standing = Object {
        id: 4,
        vy_mps: 0.1,
        moving: 0,
        ..car
    };
    [car, standing]
}

fn vehicle() -> Vehicle {
    Vehicle {
        frames: "map,odom,base_link,radar".parse().unwrap(),
        mounting: "0,0,0".parse().unwrap(),
    }
}

fn close(found: &[f64], expected: &[f64]) {
    let far = |(a, b): (&f64, &f64)| (a - b).abs() > 1e-12;
    assert_eq!(found.len(), expected.len());
    let differ = found.iter().zip(expected).any(far);
    assert!(!differ, "{found:?} {expected:?}");
}

fn place(pose: &Pose) -> [f64; 3] {
    assert_eq!((pose.orientation.x, pose.orientation.y), (0.0, 0.0));
    let yaw_rad = 2.0 * pose.orientation.z.atan2(pose.orientation.w);
    [pose.position.x, pose.position.y, yaw_rad]
}

#[test]
fn objects_are_detections_with_identity_class_box_and_covariance() {
    let array = detections(STAMP_NS, &vehicle(), &objects());
    assert_eq!(array.header.stamp.ns(), STAMP_NS);
    assert_eq!(array.header.frame_id, "odom");
    let [car, standing] = &array.detections[..] else {
        panic!("{array:?}");
    };
    assert_eq!((car.id.as_str(), standing.id.as_str()), ("17", "4"));
    assert_eq!(car.header, array.header);
    let class = |object: &Detection3D| {
        let hypothesis = object.results[0].hypothesis.clone();
        assert_eq!((object.results.len(), hypothesis.score), (1, 1.0));
        hypothesis.class_id
    };
    assert_eq!(class(car), "moving");
    assert_eq!(class(standing), "standing");
    let size = car.bbox.size;
    assert_eq!([size.x, size.y, size.z], [4.5, 1.75, 0.0]);
    close(&place(&car.bbox.center), &[20.0, 3.0, -FRAC_PI_2]);
    let result = &car.results[0].pose;
    assert_eq!(result.pose, car.bbox.center);
    let mut expected = [0.0; 36];
    for diagonal in 0..6 {
        expected[7 * diagonal] = UNKNOWN;
    }
    (expected[0], expected[1]) = (0.25, 0.125);
    (expected[6], expected[7]) = (0.125, 0.75);
    close(result.covariance.elements(), &expected);
}

#[test]
fn objects_are_where_they_are_from_the_vehicle_whose_radar_looks_elsewhere() {
    // The direction ahead of the radar is to the left of the vehicle.
    let vehicle = Vehicle {
        frames: "map,odo,car,top".parse().unwrap(),
        mounting: "1,0,90".parse().unwrap(),
    };
    let array = detections(STAMP_NS, &vehicle, &objects());
    assert_eq!(array.header.frame_id, "odo");
    let car = &array.detections[0];
    close(&place(&car.bbox.center), &[-2.0, 20.0, 0.0]);
    let covariance = car.results[0].pose.covariance.elements();
    let found = [0, 1, 6, 7].map(|element| covariance[element]);
    close(&found, &[0.75, -0.125, -0.125, 0.25]);
    let shapes = markers(STAMP_NS, &vehicle, &objects()).markers;
    let arrow = shapes.iter().find(|it| it.ns == "velocities").unwrap();
    close(&place(&arrow.pose), &[-2.0, 20.0, 0.0]);
}

#[test]
fn markers_are_boxes_with_identities_and_arrows_of_what_moves() {
    let mut objects = objects();
    objects[0].vx_mps = -9.0;
    let shapes = markers(STAMP_NS, &vehicle(), &objects).markers;
    let kinds: Vec<(i32, i32)> = shapes.iter().map(|it| (it.r#type, it.id)).collect();
    let expected = [
        (CUBE, 0),
        (TEXT_VIEW_FACING, 0),
        (ARROW, 0),
        (CUBE, 1),
        (TEXT_VIEW_FACING, 1),
    ];
    // The objects of the scan before are removed first.
    assert_eq!(shapes[0].action, DELETEALL);
    assert_eq!(kinds[1..], expected);
    let is_in_odom = |it: &Marker| it.header.frame_id == "odom" && it.header.stamp.ns() == STAMP_NS;
    assert!(shapes.iter().all(is_in_odom));
    let [cube, name, arrow] = &shapes[1..4] else {
        panic!("{shapes:?}");
    };
    let size = cube.scale;
    assert_eq!([size.x, size.y, size.z], [4.5, 1.75, 1.6]);
    assert_eq!((cube.pose.position.z, name.text.as_str()), (0.8, "17"));
    close(&place(&arrow.pose), &[20.0, 3.0, -0.75 * PI]);
    close(&[arrow.scale.x], &[9.0 / FRAC_1_SQRT_2]);
    assert_ne!(cube.color, shapes[4].color);
}
