//! A node of ROS 2 (rclpy on Fast DDS) receives the messages of a run, and Cyclone DDS those for
//! which that ROS 2 has no packages. All on the loopback, each test in a domain of its own, as the
//! tests of [`ros2_driver`](super::ros2_driver).

mod program;

use std::collections::BTreeMap;

use rustix::process::Signal;
use serde_json::Value;

use crate::{
    PROJECT,
    common::{Run, odometry, recording, script, send},
    reach::only_if,
    restart::faults::configurations::without_doppler,
};
pub(crate) use program::{Program, can_speak, domain, has_ros, number, received, stamp_ns};

/// The variance of an unmeasured quantity.
const UNKNOWN: f64 = 1e6;

/// Asserts that odometry has the poses of the results, and no measured velocity where nothing was
/// measured. Covariances and velocities have tests beside their conversion.
fn assert_odometry(found: &[Value], run: &Run) {
    let of_pose = ["stamp_ns", "x_m", "y_m", "yaw_rad", "cov_xx"];
    let poses = odometry::columns(&run.result("poses.csv"), &of_pose);
    let outcomes = odometry::columns(&run.odometry(), &["outcome"]).concat();
    assert_eq!(found.len(), poses.len());
    for (index, (found, row)) in found.iter().zip(&poses).enumerate() {
        assert_eq!(stamp_ns(&found["header"]).to_string(), row[0]);
        assert_eq!(found["header"]["frame_id"], "odom");
        assert_eq!(found["child_frame_id"], "base_link");
        let (pose, covariance) = (&found["pose"]["pose"], &found["pose"]["covariance"]);
        let [x_m, y_m] = ["x", "y"].map(|axis| number(&pose["position"][axis]));
        let [sine, cosine] = ["z", "w"].map(|part| number(&pose["orientation"][part]));
        let yaw_rad = gyre_geometry::wrap_angle(2.0 * sine.atan2(cosine));
        let values = [x_m, y_m, yaw_rad, number(&covariance[0])];
        for (found, expected) in values.iter().zip(&row[1..]) {
            let apart = found - expected.parse::<f64>().unwrap();
            assert!(apart.abs() < 1e-5, "{index}: {found} {expected}");
        }
        let outcome = index.checked_sub(1).map(|before| &outcomes[before]);
        let is_measured = outcome.is_some_and(|outcome| outcome != "predicted");
        let of_velocity = number(&found["twist"]["covariance"][0]);
        assert_eq!(of_velocity < UNKNOWN, is_measured);
    }
}

fn planar(place: &Value, turn: &Value) -> [f64; 4] {
    [&place["x"], &place["y"], &turn["z"], &turn["w"]].map(number)
}

/// The transforms of a topic as the frames that they are between, with each pose.
pub(crate) fn transforms(messages: &[Value]) -> Vec<(i64, String, [f64; 4])> {
    let all = messages
        .iter()
        .flat_map(|message| message["transforms"].as_array().unwrap());
    all.map(|it| {
        let [from, to] = [&it["header"]["frame_id"], &it["child_frame_id"]];
        let frames = format!("{} -> {}", from.as_str().unwrap(), to.as_str().unwrap());
        let (of, stamp_ns) = (&it["transform"], stamp_ns(&it["header"]));
        (
            stamp_ns,
            frames,
            planar(&of["translation"], &of["rotation"]),
        )
    })
    .collect()
}

/// Waits until a bridge has published the whole run without a loss.
fn assert_whole(bridge: &mut Program) {
    let said = bridge.await_end();
    let nothing = "0 poses missed; 0 messages not sent because readers were behind";
    assert!(said.ends_with(nothing), "{said}");
}

/// Reliably, and as sensor data.
#[test]
fn a_node_of_ros_receives_each_pose_with_its_stamp_frames_and_covariance() {
    only_if!(can_speak() && has_ros());
    // The queue holds two seconds, should the bridge be late.
    let run = Run::of_recording().rate("2");
    let domain = domain(0);
    let mut bridge = Program::bridge(&run, &domain, &["--mounting", "0,0,0"]);
    let peer = Program::peer("observer.py", &[&domain, "/"]);
    let node = Program::node(&domain, &["/"]);
    let undisturbed = run.complete();
    assert_whole(&mut bridge);
    let mut topics = received(node);
    topics.extend(received(peer));
    bridge.interrupt();

    assert_odometry(&topics["/odom"], &run);
    assert_eq!(stamps(&topics["sensor"]), stamps(&topics["/odom"]));
    assert!(topics["sensor"] == topics["/odom"]);
    assert_eq!(Run::of_recording().complete(), undisturbed);
    let of_poses = transforms(&topics["/tf"]);
    assert_eq!(of_poses.len(), topics["/odom"].len());
    for ((stamp, frames, values), odometry) in of_poses.iter().zip(&topics["/odom"]) {
        let pose = &odometry["pose"]["pose"];
        assert_eq!(*stamp, stamp_ns(&odometry["header"]));
        assert_eq!(frames, "odom -> base_link");
        assert_eq!(*values, planar(&pose["position"], &pose["orientation"]));
    }
    let [(_, frames, values)] = &transforms(&topics["/tf_static"])[..] else {
        panic!("{:?}", topics["/tf_static"]);
    };
    assert_eq!(frames, "base_link -> radar");
    assert_eq!(*values, [0.0, 0.0, 0.0, 1.0]);
    assert!(!topics.contains_key("/map"));
    assert!(!topics.contains_key("/objects"));
    let parts = topics["/diagnostics"].iter().map(|it| &it["status"]);
    let parts: Vec<_> = parts.flat_map(|it| it.as_array().unwrap()).collect();
    let is = |part: &Value, name: &str| part["name"] == name && part["level"] == 0;
    let is_well = |name| parts.iter().any(|part| is(part, name));
    for name in ["gyre", "gyre: motion", "gyre: masking"] {
        assert!(is_well(name), "{name}: {parts:?}");
    }
}

/// As `robot_localization` needs it, which publishes the transform of odometry itself and predicts
/// where nothing was measured.
#[test]
fn a_filter_can_have_its_own_transforms_and_sees_which_velocities_are_predicted() {
    only_if!(can_speak() && has_ros());
    let settings = ["refinement.min_overlap=1", "refinement.firm_overlap=1"];
    let run = settings.into_iter().fold(Run::of_recording(), Run::set);
    let run = run.rate("2");
    let domain = domain(7);
    let mut bridge = Program::bridge(&run, &domain, &["--no-tf"]);
    let peer = Program::peer("observer.py", &[&domain, "/", "/tf"]);
    let node = Program::node(&domain, &["/"]);
    run.finish().failed_with(&["predicted motions"]);
    bridge.await_end();
    let mut topics = received(node);
    topics.extend(received(peer));

    let outcomes = odometry::columns(&run.odometry(), &["outcome"]).concat();
    let predicted = outcomes.iter().filter(|word| *word == "predicted").count();
    assert!(predicted > 0 && predicted < outcomes.len(), "{outcomes:?}");
    assert_odometry(&topics["/odom"], &run);
    assert!(!topics.contains_key("/tf"), "{:?}", topics["/tf"]);
    assert_eq!(transforms(&topics["/tf_static"])[0].1, "base_link -> radar");
}

fn stamps(messages: &[Value]) -> Vec<i64> {
    messages.iter().map(|it| stamp_ns(&it["header"])).collect()
}

#[test]
fn a_node_of_ros_gives_a_running_run_a_pose_a_new_map_and_a_reset() {
    only_if!(has_ros());
    let run = Run::of_recording().set("slam.kind=graph").rate("0.7");
    let domain = domain(19);
    let mut bridge = Program::bridge(&run, &domain, &[]);
    let mut node = Program::node(&domain, &["/"]);
    let running = run.started(3);
    node.write("commands");
    running.finish().succeeded();
    bridge.await_end();
    let topics = received(node);
    for service in ["new_map", "reset"] {
        let [answer] = &topics[service][..] else {
            panic!("{:?}", topics[service]);
        };
        assert_eq!(answer["success"], true, "{answer}");
    }
    run.assert_counts("commands=3 breaks=2");
    let places = topics["/odom"]
        .iter()
        .map(|it| &it["pose"]["pose"]["position"]);
    let places: Vec<[f64; 2]> = places
        .map(|it| ["x", "y"].map(|axis| number(&it[axis])))
        .collect();
    let is_at = |it: &[f64; 2], x: f64, y: f64| (it[0] - x).hypot(it[1] - y) < 1e-9;
    let given = places.iter().position(|it| is_at(it, 40.0, -30.0));
    let reset = places.iter().rposition(|it| is_at(it, 0.0, 0.0));
    assert!(given > Some(0) && reset > given, "{places:?}");
}

#[test]
fn a_replay_gives_the_time_to_nodes_with_simulated_time() {
    only_if!(has_ros());
    let (run, domain) = (Run::of_recording().rate("2"), domain(12));
    let mut bridge = Program::bridge(&run, &domain, &["--clock"]);
    let node = Program::node(&domain, &["/", "sim"]);
    run.complete();
    bridge.await_end();
    let topics = received(node);

    assert_odometry(&topics["/odom"], &run);
    let stamps = stamps(&topics["/odom"]);
    let of_clock = |it: &Value| {
        let part = |name: &str| it["clock"][name].as_i64().unwrap();
        part("sec") * 1_000_000_000 + part("nanosec")
    };
    let clock: Vec<i64> = topics["/clock"].iter().map(of_clock).collect();
    assert!(clock.iter().all(|time| stamps.contains(time)));
    let now: Vec<i64> = topics["now"].iter().filter_map(Value::as_i64).collect();
    assert!(now.is_sorted() && clock.is_sorted());
    assert_eq!((clock.last(), now.last()), (stamps.last(), stamps.last()));
}

#[test]
fn both_sides_can_start_again_and_a_late_node_receives_the_map() {
    only_if!(has_ros());
    let data = recording::around_a_block();
    let run = Run::small().data(data).set("slam.kind=graph").rate("6");
    let domain = domain(13);
    let bridge = Program::bridge(&run, &domain, &[]);
    let node = Program::node(&domain, &["/"]);
    let mut running = run.start();
    running.await_poses(30);
    drop(bridge);
    running.await_poses(45);
    let mut bridge = Program::bridge(&run, &domain, &[]);
    running.finish().succeeded();
    bridge.await_end();
    let topics = received(node);
    let mut late = Program::node(&domain, &["/"]);
    late.await_words("\"topic\": \"/map\"");
    let late = received(late);

    let all = odometry::columns(&run.result("poses.csv"), &["stamp_ns"]).concat();
    let all: Vec<i64> = all.iter().filter_map(|stamp| stamp.parse().ok()).collect();
    let found = stamps(&topics["/odom"]);
    assert!(found.is_sorted_by(|earlier, later| earlier < later));
    assert!(found.iter().all(|stamp| all.contains(stamp)));
    // Each bridge begins with the poses that are in the queue of an observer.
    assert!(found.contains(&all[20]) && found.last() == all.last());
    assert!(!late.contains_key("/odom"), "{late:?}");
}

#[test]
fn a_managed_node_publishes_once_it_is_active() {
    only_if!(has_ros());
    let (run, domain) = (Run::of_recording().rate("3"), domain(14));
    let options = ["--managed", "--ros-args", "-r", "__ns:=/car"];
    let mut bridge = Program::bridge(&run, &domain, &options);
    let mut node = Program::node(&domain, &["/car"]);
    let idle = run.complete();
    let said = bridge.await_end();
    node.write("lifecycle");
    for event in [
        "{\"id\": 2, \"label\": \"inactive\"}}}",
        "{\"id\": 3, \"label\": \"active\"}}}",
    ] {
        node.await_words(&format!("\"goal_state\": {event}"));
    }
    let again = run.clone().option("--fresh").complete();
    assert_whole(&mut bridge);
    let topics = received(node);

    assert_eq!(idle, again);
    let held_back = "24 poses not published, since the node was not active";
    assert!(said.ends_with(held_back), "{said}");
    assert_odometry(&topics["/car/odom"], &run);
}

/// The answer to a command waits for a scan.
#[test]
fn a_command_that_waits_holds_up_no_other_request() {
    only_if!(has_ros());
    let (run, domain) = (Run::of_recording().rate("2"), domain(2));
    let run = run.set("slam.kind=graph");
    let _bridge = Program::bridge(&run, &domain, &["--managed"]);
    let mut node = Program::node(&domain, &["/"]);
    let mut running = run.started(3);
    send(running.await_stage("radar-replay"), Signal::STOP);
    node.write("meanwhile");
    node.await_words("{\"topic\": \"still waits\", \"message\": true}");
}

#[test]
fn the_launch_file_starts_the_bridge() {
    let example = format!("{PROJECT}/examples/ros2.launch.py");
    let words = script("reach/ros2/launch.py")
        .arg(example)
        .output()
        .unwrap();
    let words = String::from_utf8(words.stdout).unwrap();
    let words: Vec<&str> = words.lines().collect();
    assert_eq!(words[..4], ["gyre", "ros2", "out/radar", "--wait"]);
    Program::bridge(&Run::small(), &domain(18), &words[4..]).interrupt();
}

#[test]
fn a_node_of_ros_receives_the_velocities_by_doppler_and_what_motions_rest_on() {
    only_if!(has_ros());
    let run = without_doppler().set("doppler.kind=auto").rate("2");
    let domain = domain(15);
    let mut bridge = Program::bridge(&run, &domain, &[]);
    let node = Program::node(&domain, &["/"]);
    run.complete();
    assert_whole(&mut bridge);
    let topics = received(node);

    let velocities = &topics["/doppler"];
    assert!(velocities.len() as u64 >= run.count("doppler/motions"));
    let linear = |message: &Value| {
        let linear = &message["twist"]["twist"]["linear"];
        (
            stamp_ns(&message["header"]),
            ["x", "y"].map(|axis| number(&linear[axis])),
        )
    };
    let of_poses: BTreeMap<i64, [f64; 2]> = topics["/odom"].iter().map(linear).collect();
    for velocity in velocities {
        assert_eq!(velocity["header"]["frame_id"], "radar");
        // The other velocity is the mean since the previous scan.
        let (stamp, velocity_mps) = linear(velocity);
        let apart = [0, 1].map(|axis: usize| (velocity_mps[axis] - of_poses[&stamp][axis]).abs());
        let is_first = velocity == &velocities[0];
        assert!(
            is_first || apart.iter().all(|it| *it < 1.0),
            "{velocity} {apart:?}"
        );
        let twist = &velocity["twist"];
        let variances = [0, 7, 35].map(|it: usize| number(&twist["covariance"][it]));
        assert!(variances[0] < 1.0 && variances[2] == UNKNOWN, "{velocity}");
    }
    let parts = topics["/diagnostics"].iter().map(|it| &it["status"]);
    let parts = parts.flat_map(|it| it.as_array().unwrap());
    let mut of_motions = parts.filter(|part| part["name"] == "gyre: motion");
    let newest = of_motions.next_back().unwrap();
    assert_eq!(newest["message"], "radar and others", "{newest}");
    let values = newest["values"].as_array().unwrap();
    let agrees = values.iter().find(|it| it["key"] == "Doppler agrees");
    let agrees: Option<u64> = agrees.and_then(|it| it["value"].as_str()?.parse().ok());
    assert!(agrees > Some(15), "{newest}");
}

#[test]
#[ignore = ".ci/nightly: ten minutes"]
fn a_node_of_ros_receives_all_poses_of_ten_minutes() {
    only_if!(has_ros());
    let scans = 2400;
    let simulation = format!(
        "[raster]\nn = 127\ncell_m = 0.8\n[simulation]\nscans = {scans}\n{}",
        recording::SENSOR
    );
    let (run, domain) = (Run::configured(&simulation).rate("1"), domain(16));
    let mut bridge = Program::bridge(&run, &domain, &[]);
    let node = Program::node(&domain, &["/"]);
    assert!(run.command().output().unwrap().status.success());
    assert_whole(&mut bridge);
    let topics = received(node);
    assert_odometry(&topics["/odom"], &run);
    assert_eq!(topics["/odom"].len(), scans);
    assert_eq!(topics["sensor"], topics["/odom"]);
}
