//! ROS 2 without ROS 2: an independent peer (Cyclone DDS) receives the messages of a run. All on
//! the loopback, each test in a domain of its own, as the tests of
//! [`ros2_driver`](super::ros2_driver).

use std::{
    collections::BTreeMap,
    io::{BufRead, BufReader, Lines},
    process::{self, Child, ChildStdout, Command, Stdio},
};

use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

use crate::{
    common::{Run, gyre, odometry, script},
    reach::{only_if, python_has},
};

/// The variance of an unmeasured quantity.
const UNKNOWN: f64 = 1e6;

/// Returns whether the peer can be started; prints why a test is skipped.
pub(crate) fn can_speak() -> bool {
    python_has("cyclonedds")
}

/// A domain that only this test of this process uses. Those above 101 share their ports with other
/// programs.
pub(crate) fn domain(test: u32) -> String {
    (1 + (process::id() % 9) * 11 + test).to_string()
}

/// A program that prints lines. Dropped, it is killed.
pub(crate) struct Program {
    child: Child,
    said: Lines<BufReader<ChildStdout>>,
}

impl Program {
    /// Starts the program, and waits for its first line.
    fn start(command: &mut Command) -> Self {
        let command = command.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let mut said = BufReader::new(child.stdout.take().unwrap()).lines();
        let first = said.next().expect("it has ended");
        first.unwrap();
        Self { child, said }
    }

    /// A peer in Python.
    pub(crate) fn peer(name: &str, arguments: &[&str]) -> Self {
        Self::start(script(&format!("reach/ros2/{name}")).args(arguments))
    }

    /// A bridge that waits for the run. Its sentences for the terminal count as its lines.
    pub(crate) fn bridge(run: &Run, domain: &str, options: &[&str]) -> Self {
        let mut command = Command::new("sh");
        command.args(["-c", "exec \"$@\" 2>&1", "sh"]);
        command.arg(gyre().get_program()).arg("ros2").arg(run.out());
        command.args(["--wait", "--domain", domain, "--interface", "127.0.0.1"]);
        Self::start(command.args(options))
    }

    /// Closes the input of the program, and returns its output up to its end.
    fn rest(mut self) -> Vec<String> {
        drop(self.child.stdin.take());
        let said = self.said.by_ref().map(Result::unwrap).collect();
        assert!(self.child.wait().unwrap().success());
        said
    }

    /// Ends the program as Ctrl-C does, and returns its output.
    pub(crate) fn interrupt(self) -> Vec<String> {
        let pid = Pid::from_child(&self.child);
        kill_process(pid, Signal::INT).unwrap();
        self.rest()
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The messages that a peer has received, by topic.
pub(crate) fn received(peer: Program) -> BTreeMap<String, Vec<Value>> {
    let mut topics: BTreeMap<String, Vec<Value>> = BTreeMap::new();
    for line in peer.rest() {
        let mut line: Value = serde_json::from_str(&line).unwrap();
        let topic = topics.entry(line["topic"].as_str().unwrap().to_owned());
        topic.or_default().push(line["message"].take());
    }
    topics
}

pub(crate) fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

pub(crate) fn stamp_ns(header: &Value) -> i64 {
    let part = |name: &str| header["stamp"][name].as_i64().unwrap();
    part("sec") * 1_000_000_000 + part("nanosec")
}

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

#[test]
fn a_node_of_ros_receives_each_pose_with_its_stamp_frames_and_covariance() {
    only_if!(can_speak());
    // The queue holds four seconds, should the bridge be late.
    let run = Run::of_recording().rate("1");
    let domain = domain(0);
    let bridge = Program::bridge(&run, &domain, &["--mounting", "0,0,0"]);
    let peer = Program::peer("observer.py", &[&domain, "/"]);
    let undisturbed = run.complete();
    let topics = received(peer);
    let said = bridge.interrupt();
    let is_whole = |line: &String| line.contains("0 poses missed; 0 messages not sent");
    assert!(said.iter().any(is_whole), "{said:?}");

    assert_odometry(&topics["/odom"], &run);
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
    assert!(is_well("gyre") && is_well("gyre: masking"), "{parts:?}");
}

/// As `robot_localization` needs it, which publishes the transform of odometry itself and predicts
/// where nothing was measured.
#[test]
fn a_filter_can_have_its_own_transforms_and_sees_which_velocities_are_predicted() {
    only_if!(can_speak());
    let settings = ["refinement.min_overlap=1", "refinement.firm_overlap=1"];
    let run = settings.into_iter().fold(Run::of_recording(), Run::set);
    let run = run.rate("1");
    let domain = domain(7);
    let bridge = Program::bridge(&run, &domain, &["--no-tf"]);
    let peer = Program::peer("observer.py", &[&domain, "/", "/tf"]);
    run.finish().failed_with(&["predicted motions"]);
    let topics = received(peer);
    bridge.interrupt();

    let outcomes = odometry::columns(&run.odometry(), &["outcome"]).concat();
    let predicted = outcomes.iter().filter(|word| *word == "predicted").count();
    assert!(predicted > 0 && predicted < outcomes.len(), "{outcomes:?}");
    assert_odometry(&topics["/odom"], &run);
    assert!(!topics.contains_key("/tf"), "{:?}", topics["/tf"]);
    assert_eq!(transforms(&topics["/tf_static"])[0].1, "base_link -> radar");
}
