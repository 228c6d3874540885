//! Messages as bytes.

use gyre_geometry::samples::Sample;
use gyre_ros2_messages::{
    Ros2Message, decode, encode,
    geometry_msgs::Quaternion,
    nav_msgs::Odometry,
    navtech_msgs::RadarFftDataMsg,
    sensor_msgs::{Imu, NavSatFix},
    std_msgs::Header,
    vision_msgs::Detection3DArray,
    visualization_msgs::{CUBE, MarkerArray},
};

#[test]
fn big_endian_messages_are_read() {
    let bytes = [
        &[0, 0, 0, 0][..],
        &[0, 0, 0, 7, 0, 0, 0, 9],
        &[0, 0, 0, 2, b'm', 0],
    ]
    .concat();
    let header: Header = decode(&bytes).unwrap();
    assert_eq!((header.stamp.sec, header.stamp.nanosec), (7, 9));
    assert_eq!(header.frame_id, "m");
}

#[test]
fn lengths_that_lie_are_refused_with_one_sentence() {
    let message = RadarFftDataMsg {
        data: vec![1; 8],
        ..RadarFftDataMsg::default()
    };
    let mut bytes = encode(&message).unwrap();
    let length = bytes.len() - 8 - 2 - 4;
    bytes[length..length + 4].copy_from_slice(&u32::MAX.to_le_bytes());
    let refused = decode::<RadarFftDataMsg>(&bytes).unwrap_err();
    assert!(refused.contains("RadarFftDataMsg"), "{refused}");
    for head in [&[][..], &[0, 1], &[0, 3, 0, 0, 1, 2, 3, 4]] {
        let refused = decode::<Header>(head).unwrap_err();
        assert!(refused.contains("does not begin a message"), "{refused}");
    }
}

#[test]
fn schemas_have_the_definitions_of_all_parts_once() {
    let text = Odometry::DEFINITION.text();
    let parts: Vec<&str> = text
        .lines()
        .filter_map(|line| line.strip_prefix("MSG: "))
        .collect();
    let expected = [
        "std_msgs/Header",
        "builtin_interfaces/Time",
        "geometry_msgs/PoseWithCovariance",
        "geometry_msgs/Pose",
        "geometry_msgs/Point",
        "geometry_msgs/Quaternion",
        "geometry_msgs/TwistWithCovariance",
        "geometry_msgs/Twist",
        "geometry_msgs/Vector3",
    ];
    assert_eq!(parts, expected);
    assert_eq!(Odometry::DEFINITION.type_name(), "nav_msgs/msg/Odometry");
    assert_eq!(
        Odometry::DEFINITION.dds_name(),
        "nav_msgs::msg::dds_::Odometry_"
    );
}

/// A sample of an inertial sensor, as rosbags 0.11.9 serialises it.
const IMU: &str = include_str!("cdr/imu.hex");

/// Reads the message of another writer, with padding as some leave it; Gyre writes it alike.
fn read<T: Ros2Message>(hexadecimal: &str) -> T {
    let digits: String = hexadecimal.lines().collect();
    let places = (0..digits.len()).step_by(2);
    let byte = |at| u8::from_str_radix(&digits[at..at + 2], 16).unwrap();
    let bytes: Vec<u8> = places.map(byte).collect();
    let message: T = decode(&[&bytes[..], &[0; 3]].concat()).unwrap();
    assert_eq!(encode(&message).unwrap(), bytes);
    message
}

#[test]
fn an_imu_of_another_writer_is_read_and_written_alike() {
    let imu: Imu = read(IMU);
    assert_eq!(imu.header, Header::new(1_549_986_608_000_000_007, "imu"));
    assert_eq!(imu.orientation, Quaternion::default());
    assert_eq!(imu.orientation_covariance[0], -1.0);
    let [turn, along] = [imu.angular_velocity, imu.linear_acceleration];
    assert_eq!([turn.x, turn.y, turn.z], [0.01, 0.02, 0.1]);
    assert_eq!(imu.angular_velocity_covariance[0], 0.5);
    assert_eq!([along.x, along.y, along.z], [0.5, 0.0, 9.8]);
    assert_eq!(imu.linear_acceleration_covariance[8], 8.0);
}

/// A fix of a GNSS receiver, as rosbags 0.11.9 serialises it.
const FIX: &str = include_str!("cdr/fix.hex");

#[test]
fn a_fix_of_another_writer_is_read_and_written_alike() {
    let fix: NavSatFix = read(FIX);
    assert_eq!(fix.header, Header::new(1_549_986_608_000_000_007, "gnss"));
    assert_eq!((fix.status.status, fix.status.service), (2, 9));
    let place = [fix.latitude, fix.longitude, fix.altitude];
    assert_eq!(place, [51.75, -1.26, 64.5]);
    assert_eq!(fix.position_covariance_type, 3);
    let stamp_ns = 1_549_986_608_000_000_007;
    let expected = Sample::fix(stamp_ns, [51.75, -1.26], 64.5, 6.5_f64.sqrt());
    assert_eq!(fix.fix(5), Some(expected));
}

#[test]
fn a_receiver_without_a_fix_or_an_accuracy_says_so() {
    let mut fix: NavSatFix = read(FIX);
    // Not yet set, none, and the kinds of fixes.
    for (status, has_fix) in [(-2, true), (-1, false), (0, true), (1, true), (2, true)] {
        fix.status.status = status;
        assert_eq!(fix.fix(5).is_some(), has_fix, "{status}");
    }
    fix.position_covariance_type = 0;
    fix.header = Header::default();
    let found = fix.fix(5).unwrap();
    assert_eq!((found.stamp_ns, found.sigma_m()), (5, None));
}

/// A detected object, as rosbags 0.11.9 serialises it.
const DETECTIONS: &str = include_str!("cdr/detections.hex");

#[test]
fn detections_of_another_writer_are_read_and_written_alike() {
    let found: Detection3DArray = read(DETECTIONS);
    let object = &found.detections[0];
    let header = Header::new(1_549_986_608_000_000_007, "odom");
    assert_eq!((&found.header, &object.header), (&header, &header));
    let result = &object.results[0];
    assert_eq!(result.hypothesis.class_id, "moving");
    assert_eq!(result.pose.pose, object.bbox.center);
    let covariance = result.pose.covariance.elements();
    let found = [0, 1, 7, 35].map(|element| covariance[element]);
    assert_eq!(found, [0.25, 0.5, 0.75, 1e6]);
    assert_eq!((object.bbox.size.x, object.id.as_str()), (4.5, "17"));
}

/// A marker with all its fields, as rosbags 0.11.9 serialises it.
const MARKERS: &str = include_str!("cdr/markers.hex");

#[test]
fn markers_of_another_writer_are_read_and_written_alike() {
    let found: MarkerArray = read(MARKERS);
    let marker = &found.markers[0];
    assert_eq!((marker.r#type, marker.scale.x), (CUBE, 4.5));
    assert_eq!((marker.color.a, marker.lifetime.nanosec), (0.75, 5));
    assert_eq!((marker.points[0].z, &*marker.text), (3.0, "17"));
    assert_eq!(marker.texture.data, [1, 2, 3]);
    assert!(marker.frame_locked && marker.mesh_use_embedded_materials);
}
