//! Samples of inertial sensors and of wheels, and the fixes of GNSS receivers, in bags.

use gyre_datasets::{GnssLog, InspectedLogs, SampleLog, inspect_dataset};
use gyre_geometry::samples::{GnssConfig, GnssKind, Sample, SampleKind};
use gyre_recording::{bags::fixes, copied_fixes, gnss_log};
use gyre_ros2_messages::{
    geometry_msgs::{TwistStamped, Vector3},
    sensor_msgs::{Imu, NavSatFix, NavSatStatus},
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

const FIXES: i64 = 30;
const FIX: &str = "/fix";

/// A drive to the north-east at 10 m/s, a fix a second.
fn fix(number: i64) -> NavSatFix {
    let mut position_covariance = [0.0; 9];
    (position_covariance[0], position_covariance[4]) = (1.0, 4.0 + number as f64);
    NavSatFix {
        header: Header::new(START_NS + 1_000_000_000 * number, "gnss"),
        status: NavSatStatus::default(),
        latitude: 51.75 + 6.3e-5 * number as f64,
        longitude: -1.26 + 1.02e-4 * number as f64,
        altitude: 64.5,
        position_covariance,
        position_covariance_type: 2,
    }
}

/// Four turns of a radar with a drive on each of these topics; `change` may change fixes.
fn with(topics: &[&str], change: impl Fn(i64, &mut NavSatFix)) -> Messages {
    let mut messages = b_scans(4);
    for topic in topics {
        for number in 0..FIXES {
            let mut fix = fix(number);
            change(number, &mut fix);
            let log_ns = START_NS + 1_000_000_000 * number + 3;
            messages.add(topic, log_ns, &fix);
        }
    }
    messages
}

/// The log of the only receiver of a bag.
fn log(messages: &Messages) -> GnssLog {
    let folder = Folder::new();
    let path = folder.bag(messages);
    let log = GnssLog::of(fixes(&path, None).unwrap().unwrap(), &path).unwrap();
    let of_scans = opened(&path).fixes(None).unwrap().unwrap();
    assert_eq!(GnssLog::of(of_scans, &path).unwrap().fixes, log.fixes);
    assert_eq!((&log.path, log.topic.as_deref()), (&path, Some(FIX)));
    log
}

#[test]
fn fixes_of_a_bag_have_their_accuracy() {
    let log = log(&with(&[FIX], |_, _| {}));
    assert_eq!(log.fixes.len() as i64, FIXES);
    assert_eq!(log.fixes[2].sigma_m, Some(3.5_f64.sqrt()));
    assert!(log.faults.named().is_empty());
}

#[test]
fn messages_without_a_fix_are_left_out_and_counted() {
    // A receiver without a fix repeats its last place. Some do not state whether they have one.
    let log = log(&with(&[FIX], |number, fix| {
        if (10..14).contains(&number) {
            fix.status.status = -1;
            fix.latitude = 51.75;
        }
        if (20..25).contains(&number) {
            fix.status.status = -2;
        }
    }));
    assert_eq!(log.fixes.len() as i64, FIXES - 4);
    assert_eq!(log.faults.without_fix, 4);
    let unknown = (5, "of unknown status, used");
    assert_eq!(log.faults.named(), [(4, "without a fix"), unknown]);
}

#[test]
fn of_several_receivers_one_is_to_be_named() {
    let folder = Folder::new();
    let path = folder.bag(&with(&[FIX, "/gps/fix"], |_, _| {}));
    let refused = fixes(&path, None).unwrap_err().to_string();
    let words =
        "fixes of a GNSS receiver on several topics, /fix, /gps/fix: choose one with gnss.topic";
    assert!(refused.contains(words), "{refused}");
    let named = fixes(&path, Some("/gps/fix")).unwrap().unwrap();
    assert_eq!(named.topic, "/gps/fix");
    assert_eq!(named.fixes.len() as i64, FIXES);
    let refused = fixes(&path, Some("/odom")).unwrap_err().to_string();
    let words = "no messages of sensor_msgs/msg/NavSatFix on the topic /odom (gnss.topic), but on: /fix, /gps/fix";
    assert!(refused.contains(words), "{refused}");
}

#[test]
fn a_bag_without_a_receiver_has_no_fixes() {
    let folder = Folder::new();
    let path = folder.bag(&b_scans(4));
    assert_eq!(fixes(&path, None).unwrap(), None);
    let refused = fixes(&path, Some(FIX)).unwrap_err().to_string();
    let words = "on the topic /fix (gnss.topic), and on no other one";
    assert!(refused.contains(words), "{refused}");
}

#[test]
fn a_run_takes_the_fixes_of_its_bag_before_a_log_beside_it_and_its_recording_keeps_them() {
    let folder = Folder::new();
    let auto = GnssConfig {
        kind: GnssKind::Auto,
        ..GnssConfig::default()
    };
    let of_run = |path: &Path| gnss_log(&auto, path, Path::new("")).map(Option::unwrap);
    let path = folder.bag(&b_scans(4));
    let refused = of_run(&path).unwrap_err().to_string();
    let words = "has no messages of sensor_msgs/msg/NavSatFix, and no log";
    assert!(refused.contains(words), "{refused}");
    let beside = folder.path("gnss.csv");
    fs::write(&beside, "stamp_s,east_m,north_m\n7,1,2\n").unwrap();
    assert_eq!(of_run(&path).unwrap().path, beside);
    let path = folder.bag(&with(&[FIX], |_, _| {}));
    let log = of_run(&path).unwrap();
    assert_eq!((&log.path, log.topic.as_deref()), (&path, Some(FIX)));
    assert_eq!(log.fixes.len() as i64, FIXES);
    fs::write(&beside, copied_fixes(&auto, &path).unwrap()).unwrap();
    let kept = GnssLog::read(&beside).unwrap();
    let stamps = |log: &GnssLog| -> Vec<i64> { log.fixes.iter().map(|it| it.stamp_ns).collect() };
    assert_eq!(stamps(&kept), stamps(&log));
    assert_eq!(kept.fixes[2].sigma_m, log.fixes[2].sigma_m);
}

#[test]
fn messages_that_are_no_fixes_are_refused() {
    let mut messages = with(&[FIX], |_, _| {});
    let (name, text) = (NavSatFix::DEFINITION.type_name(), "");
    let cut = encode(&fix(0)).unwrap()[..40].to_vec();
    messages.add_bytes(FIX, (&name, text), START_NS, cut);
    let folder = Folder::new();
    let refused = fixes(&folder.bag(&messages), None).unwrap_err().to_string();
    let words = "has messages on /fix that are no fixes of a GNSS receiver";
    assert!(refused.contains(words), "{refused}");
}

#[test]
fn fixes_are_read_without_scans_and_beside_other_sensors() {
    let mut messages = Messages::default();
    for number in 0..FIXES {
        let log_ns = START_NS + 1_000_000_000 * number;
        messages.add("/imu/data", log_ns, &Imu::default());
        messages.add(FIX, log_ns, &fix(number));
    }
    let folder = Folder::new();
    for chunk in [None, Some(500)] {
        let path = folder.path("bag.mcap");
        messages.write(&path, uncompressed().chunk_size(chunk));
        let found = fixes(&path, None).unwrap().unwrap();
        assert_eq!(found.fixes.len() as i64, FIXES);
    }
}

#[test]
fn a_report_has_the_fixes_of_the_bag_or_why_they_cannot_be_used() {
    let folder = Folder::new();
    let inspected = |messages: &Messages, topic: Option<&str>| {
        let path = folder.bag(messages);
        let dataset = opened(&path);
        let logs = InspectedLogs {
            gnss_topic: topic.map(str::to_owned),
            ..InspectedLogs::default()
        };
        inspect_dataset(&path, dataset, &DatasetOptions::default(), &logs, None)
    };
    let two = with(&[FIX, "/gps/fix"], |number, fix| {
        fix.status.status = -i8::from(number == 0);
    });
    let report = inspected(&two, Some(FIX));
    let gnss = &report.figures["gnss"];
    assert_eq!(gnss["topic"], FIX);
    assert_eq!(gnss["samples"], FIXES - 1);
    assert_eq!(gnss["faults"]["without_fix"], 1);
    let text = report.to_string();
    for words in [
        "gnss          /fix: up to 2",
        "left out, or sorted: 1 without a fix.",
        "The log of a GNSS receiver, /fix, whose stamps do not cover those of the scans, is in the bag",
    ] {
        assert!(text.contains(words), "{words}: {text}");
    }
    let text = inspected(&two, None).to_string();
    assert!(text.contains("choose one with gnss.topic"), "{text}");
    assert!(inspected(&b_scans(4), None).figures["gnss"].is_null());
}
