//! Samples of inertial sensors and of wheels, and the fixes of GNSS receivers, in bags.

use gyre_datasets::{InspectedLogs, SampleLog, inspect_dataset};
use gyre_geometry::samples::{
    GnssConfig, Logged,
    SampleKind::{self, Gnss, Gyro, Wheels},
    SensorKind,
};
use gyre_recording::{bags::logged, copied_fixes, gnss_log};
use gyre_ros2_messages::{
    geometry_msgs::{TwistStamped, Vector3},
    sensor_msgs::{Imu, NavSatFix, NavSatStatus},
    std_msgs::Header,
};

use super::*;

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

/// Four turns of a radar, with 30 messages on each of these topics, by the types that their names
/// imply.
fn with(topics: &[&str]) -> Messages {
    with_changed(topics, |_, _| {})
}

/// The same; `change` may change fixes.
fn with_changed(topics: &[&str], change: impl Fn(i64, &mut NavSatFix)) -> Messages {
    let mut messages = b_scans(4);
    let (mut odometry, mut twist) = (Odometry::default(), TwistStamped::default());
    (odometry.twist.twist.linear.x, twist.twist.linear.x) = (8.25, -0.5);
    for (topic, number) in topics
        .iter()
        .flat_map(|it| (0..FIXES).map(move |k| (*it, k)))
    {
        let log_ns = START_NS + 1_000_000_000 * number + 3;
        let (imu, mut fix) = (imu(number), fix(number));
        change(number, &mut fix);
        imu.header.clone_into(&mut odometry.header);
        imu.header.clone_into(&mut twist.header);
        match topic {
            "/odom" => messages.add(topic, log_ns, &odometry),
            "/speed" => messages.add(topic, log_ns, &twist),
            _ if topic.starts_with("/imu") => messages.add(topic, log_ns, &imu),
            _ => messages.add(topic, log_ns, &fix),
        }
    }
    messages
}

/// Reads the samples of a bag, without its scans and with them.
fn read(
    messages: &Messages,
    of: SampleKind,
    topic: Option<&str>,
) -> Result<Option<Logged>, String> {
    let folder = Folder::new();
    let path = folder.bag(messages);
    let read = logged(&path, of, topic).map_err(|error| error.to_string());
    let mut dataset = opened(&path);
    let of_scans = dataset.logged(of, topic);
    let of_scans = of_scans.map_err(|error| error.to_string());
    // Rates that were not measured are not equal to themselves.
    assert_eq!(format!("{of_scans:?}"), format!("{read:?}"));
    assert_has_turns(dataset.as_mut(), 4);
    read
}

#[test]
fn samples_are_of_the_only_topic_or_of_the_one_that_is_named() {
    // The sensor, its topics, the topic that is named, and the first value or the refusal.
    for (of, case) in [
        (Gyro, "/imu/data /fix||0.01"),
        (
            Gyro,
            "/imu/data /imu/other||samples of the gyro on several topics, /imu/data, /imu/other: choose one with gyro.topic",
        ),
        (Wheels, "/odom /speed|/odom|8.25"),
        (Wheels, "/odom /speed|/speed|-0.5"),
        (
            Wheels,
            "/odom /speed||speeds on /odom, /speed: name the topic that is of wheels with wheels.topic",
        ),
        (Gnss, "/imu/data /fix||51.75"),
        (Gnss, "/fix /gps/fix|/gps/fix|51.75"),
        (
            Gnss,
            "/fix /gps/fix||fixes of a GNSS receiver on several topics, /fix, /gps/fix: choose one with gnss.topic",
        ),
        (
            Gnss,
            "/fix /gps/fix|/odom|no messages of sensor_msgs/msg/NavSatFix on the topic /odom (gnss.topic), but on: /fix, /gps/fix",
        ),
        (
            Gnss,
            "|/fix|on the topic /fix (gnss.topic), and on no other one",
        ),
    ] {
        let parts: Vec<&str> = case.split('|').collect();
        let topics: Vec<&str> = parts[0].split_whitespace().collect();
        let wished = Some(parts[1]).filter(|topic| !topic.is_empty());
        match read(&with(&topics), of, wished) {
            Ok(logged) => {
                let logged = logged.unwrap();
                assert_eq!(logged.samples.len() as i64, FIXES, "{case}");
                assert_eq!(logged.samples[0].values[0].to_string(), parts[2]);
                let period_ns = if of == Gnss {
                    1_000_000_000
                } else {
                    25_000_000
                };
                assert_eq!(logged.samples[7].stamp_ns, START_NS + 7 * period_ns);
                let known = |topic: &str| wished.unwrap_or(topic) == topic;
                assert!(logged.topic.is_some_and(|topic| known(&topic)), "{case}");
            }
            Err(refused) => assert!(refused.contains(parts[2]), "{case}: {refused}"),
        }
    }
    for of in [Gyro, Wheels, Gnss] {
        assert_eq!(read(&with(&[]), of, None), Ok(None));
    }
    let gyro = read(&with(&["/imu/data"]), Gyro, None).unwrap().unwrap();
    assert_eq!(gyro.samples[7].values, [0.01, 0.02, 0.1, 0.5, 0.0, 9.8]);
}

#[test]
fn a_driver_without_stamps_has_the_times_of_receipt_and_messages_without_rates_are_counted() {
    let mut messages = b_scans(4);
    let mut unstamped = imu(0);
    unstamped.header.stamp = gyre_ros2_messages::builtin_interfaces::Time::default();
    messages.add("/imu/data", START_NS + 77, &unstamped);
    for number in 1..4 {
        let mut rateless = imu(number);
        rateless.angular_velocity_covariance[0] = -1.0;
        messages.add("/imu/data", START_NS + 99, &rateless);
    }
    let logged = read(&messages, Gyro, None).unwrap().unwrap();
    let log = SampleLog::of(Gyro, logged, Path::new("bag")).unwrap();
    assert_eq!(log.samples[0].stamp_ns, START_NS + 77);
    assert_eq!((log.samples.len(), log.faults.not_a_number), (1, 3));
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

/// The log of the only receiver of a bag.
fn log(messages: &Messages) -> SampleLog {
    let logged = read(messages, Gnss, None).unwrap().unwrap();
    SampleLog::of(Gnss, logged, Path::new("bag")).unwrap()
}

#[test]
fn fixes_of_a_bag_have_their_accuracy() {
    let log = log(&with(&[FIX]));
    assert_eq!(log.samples.len() as i64, FIXES);
    assert_eq!(log.samples[2].sigma_m(), Some(3.5_f64.sqrt()));
    assert!(log.sentences().is_empty());
}

#[test]
fn messages_without_a_fix_are_left_out_and_counted() {
    // A receiver without a fix repeats its last place. Some do not state whether they have one.
    let log = log(&with_changed(&[FIX], |number, fix| {
        if (10..14).contains(&number) {
            fix.status.status = -1;
            fix.latitude = 51.75;
        }
        if (20..25).contains(&number) {
            fix.status.status = -2;
        }
    }));
    assert_eq!(log.samples.len() as i64, FIXES - 4);
    assert_eq!(log.faults.without_fix, 4);
    let unknown = "5 of unknown status, used";
    assert_eq!(log.faults.named(Gnss), ["4 without a fix", unknown]);
}

#[test]
fn a_run_takes_the_fixes_of_its_bag_before_a_log_beside_it_and_its_recording_keeps_them() {
    let folder = Folder::new();
    let auto = GnssConfig {
        kind: SensorKind::Auto,
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
    let path = folder.bag(&with(&[FIX]));
    let log = of_run(&path).unwrap();
    assert_eq!((&log.path, log.topic.as_deref()), (&path, Some(FIX)));
    assert_eq!(log.samples.len() as i64, FIXES);
    fs::write(&beside, copied_fixes(&auto, &path).unwrap()).unwrap();
    let kept = SampleLog::read(Gnss, &beside, None).unwrap();
    let stamps =
        |log: &SampleLog| -> Vec<i64> { log.samples.iter().map(|it| it.stamp_ns).collect() };
    assert_eq!(stamps(&kept), stamps(&log));
    assert_eq!(kept.samples[2].sigma_m(), log.samples[2].sigma_m());
}

#[test]
fn messages_that_are_no_fixes_are_refused() {
    let mut messages = with(&[FIX]);
    let (name, text) = (NavSatFix::DEFINITION.type_name(), "");
    let cut = encode(&fix(0)).unwrap()[..40].to_vec();
    messages.add_bytes(FIX, (&name, text), START_NS, cut);
    let folder = Folder::new();
    let refused = logged(&folder.bag(&messages), Gnss, None).unwrap_err();
    let refused = refused.to_string();
    let words = "has messages on /fix that are no fixes of a GNSS receiver";
    assert!(refused.contains(words), "{refused}");
}

#[test]
fn samples_are_read_without_scans_whatever_the_chunks_are() {
    let mut messages = Messages::default();
    for number in 0..FIXES {
        let log_ns = START_NS + 1_000_000_000 * number;
        messages.add("/imu/data", log_ns, &imu(number));
        messages.add(FIX, log_ns, &fix(number));
    }
    let folder = Folder::new();
    for chunk in [None, Some(500)] {
        let path = folder.path("bag.mcap");
        messages.write(&path, uncompressed().chunk_size(chunk));
        for of in [Gyro, Gnss] {
            let found = logged(&path, of, None).unwrap().unwrap();
            assert_eq!(found.samples.len() as i64, FIXES);
        }
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
        inspect_dataset(&path, dataset, &DatasetOptions::default(), &logs)
    };
    let two = with_changed(&[FIX, "/gps/fix"], |number, fix| {
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
