//! Samples of inertial sensors in bags.

use gyre_ros2_messages::{geometry_msgs::Vector3, sensor_msgs::Imu, std_msgs::Header};

use super::*;

const SAMPLES: i64 = 40;

/// A rate of 0.1 rad/s about z each 25 ms.
fn imu(number: i64) -> Imu {
    Imu {
        header: Header::new(START_NS + 25_000_000 * number, "imu"),
        angular_velocity: Vector3 {
            x: 0.01,
            y: 0.02,
            z: 0.1,
        },
        linear_acceleration: Vector3 {
            x: 0.5,
            y: 0.0,
            z: 9.8,
        },
        ..Imu::default()
    }
}

/// Four turns of a radar, with the samples of a gyro on each of these topics.
fn with_gyros(topics: &[&str]) -> Messages {
    let mut messages = b_scans(4);
    for topic in topics {
        for number in 0..SAMPLES {
            messages.add(topic, START_NS + 25_000_000 * number + 3, &imu(number));
        }
    }
    messages
}

#[test]
fn the_samples_of_the_only_gyro_are_read() {
    let folder = Folder::new();
    let mut dataset = opened(&folder.bag(&with_gyros(&["/imu/data"])));
    assert_has_turns(dataset.as_mut(), 4);
    let samples = dataset.gyro(None).unwrap().unwrap();
    assert_eq!(samples.len() as i64, SAMPLES);
    assert_eq!(samples[7].stamp_ns, START_NS + 7 * 25_000_000);
    assert_eq!(samples[7].values, [0.01, 0.02, 0.1, 0.5, 0.0, 9.8]);
    assert_has_turns(dataset.as_mut(), 4);
}

#[test]
fn a_bag_without_a_gyro_has_no_samples() {
    let folder = Folder::new();
    let mut dataset = opened(&folder.bag(&b_scans(4)));
    assert_eq!(dataset.gyro(None).unwrap(), None);
    let refused = dataset.gyro(Some("/imu/data")).unwrap_err().to_string();
    assert!(
        refused.contains("on the topic /imu/data (gyro.topic)"),
        "{refused}"
    );
}

#[test]
fn of_several_gyros_one_is_to_be_named() {
    let folder = Folder::new();
    let mut dataset = opened(&folder.bag(&with_gyros(&["/imu/data", "/imu/raw"])));
    let refused = dataset.gyro(None).unwrap_err().to_string();
    let words = "gyros on several topics, /imu/data, /imu/raw: choose one with gyro.topic";
    assert!(refused.contains(words), "{refused}");
    let samples = dataset.gyro(Some("/imu/raw")).unwrap().unwrap();
    assert_eq!(samples.len() as i64, SAMPLES);
}

#[test]
fn a_driver_without_stamps_has_the_times_of_receipt_and_one_without_rates_is_refused() {
    let mut messages = b_scans(4);
    let mut unstamped = imu(0);
    unstamped.header.stamp = gyre_ros2_messages::builtin_interfaces::Time::default();
    messages.add("/imu/data", START_NS + 77, &unstamped);
    let folder = Folder::new();
    let mut dataset = opened(&folder.bag(&messages));
    let samples = dataset.gyro(None).unwrap().unwrap();
    assert_eq!(samples[0].stamp_ns, START_NS + 77);

    let mut rateless = imu(1);
    rateless.angular_velocity_covariance[0] = -1.0;
    messages.add("/imu/data", START_NS + 99, &rateless);
    let mut dataset = opened(&folder.bag(&messages));
    let refused = dataset.gyro(None).unwrap_err().to_string();
    assert!(refused.contains("no angular velocity"), "{refused}");
}
