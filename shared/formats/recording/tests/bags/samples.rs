//! Samples of inertial sensors and of wheels in bags.

use gyre_datasets::SampleLog;
use gyre_geometry::samples::{Sample, SampleKind};
use gyre_ros2_messages::{
    geometry_msgs::{TwistStamped, Vector3},
    sensor_msgs::Imu,
    std_msgs::Header,
};

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

fn of_gyro(
    dataset: &mut dyn Dataset,
    topic: Option<&str>,
) -> Result<Option<Vec<Sample>>, OpenError> {
    dataset.logged(SampleKind::Gyro, topic)
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
    let samples = of_gyro(dataset.as_mut(), None).unwrap().unwrap();
    assert_eq!(samples.len() as i64, SAMPLES);
    assert_eq!(samples[7].stamp_ns, START_NS + 7 * 25_000_000);
    assert_eq!(samples[7].values, [0.01, 0.02, 0.1, 0.5, 0.0, 9.8]);
    assert_has_turns(dataset.as_mut(), 4);
}

#[test]
fn a_driver_without_stamps_has_the_times_of_receipt_and_messages_without_rates_are_counted() {
    let mut messages = b_scans(4);
    let mut unstamped = imu(0);
    unstamped.header.stamp = gyre_ros2_messages::builtin_interfaces::Time::default();
    messages.add("/imu/data", START_NS + 77, &unstamped);
    let folder = Folder::new();
    let mut dataset = opened(&folder.bag(&messages));
    let samples = of_gyro(dataset.as_mut(), None).unwrap().unwrap();
    assert_eq!(samples[0].stamp_ns, START_NS + 77);

    for number in 1..4 {
        let mut rateless = imu(number);
        rateless.angular_velocity_covariance[0] = -1.0;
        messages.add("/imu/data", START_NS + 99, &rateless);
    }
    let mut dataset = opened(&folder.bag(&messages));
    let samples = of_gyro(dataset.as_mut(), None).unwrap().unwrap();
    let log = SampleLog::of_gyro(samples, &folder.path("bag")).unwrap();
    assert_eq!((log.samples.len(), log.faults.not_a_number), (1, 3));
}

#[test]
fn the_speed_of_the_wheels_is_that_of_odometry_or_of_a_twist() {
    let folder = Folder::new();
    let mut messages = b_scans(4);
    let stamp_ns = |number: i64| START_NS + 50_000_000 * number;
    let mut odometry = Odometry::default();
    odometry.twist.twist.linear.x = 8.25;
    let mut twist = TwistStamped::default();
    twist.twist.linear.x = -0.5;
    for number in 0..20 {
        odometry.header = Header::new(stamp_ns(number), "odom");
        twist.header = Header::new(stamp_ns(number), "base_link");
        messages.add("/odom", stamp_ns(number) + 3, &odometry);
        messages.add("/speed", stamp_ns(number) + 3, &twist);
    }
    let mut dataset = opened(&folder.bag(&messages));
    let mut wheels = |topic| dataset.logged(SampleKind::Wheels, topic);
    for (topic, speed_mps) in [("/odom", 8.25), ("/speed", -0.5)] {
        let samples = wheels(Some(topic)).unwrap().unwrap();
        let expected = (0..20).map(|number| Sample::speed(stamp_ns(number), speed_mps));
        assert_eq!(samples, expected.collect::<Vec<_>>());
    }
    let refused = wheels(None).unwrap_err().to_string();
    let words = "speeds on /odom, /speed: name the topic that is of wheels with wheels.topic";
    assert!(refused.contains(words), "{refused}");
    assert_has_turns(dataset.as_mut(), 4);
}
