//! ROS 2 without ROS 2: an independent peer (Cyclone DDS) receives the messages of a run. All on
//! the loopback, each test in a domain of its own, as the tests of
//! [`ros2_driver`](super::ros2_driver).

use std::{
    collections::BTreeMap,
    io::{BufRead, BufReader, Lines},
    path::Path,
    process::{self, Child, ChildStdout, Command, Stdio},
};

use gyre_geometry::{ComposedMotion, OdometryMotion, UncertainMotion, covariance, pose};
use nalgebra::{Matrix3, Vector3};
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

use crate::common::{Run, gyre, odometry, python};

/// The variance of an unmeasured quantity.
const UNKNOWN: f64 = 1e6;
/// Where x, y and yaw are among the values of ROS.
const PLANAR: [usize; 3] = [0, 1, 5];

/// Returns whether the peer can be started; prints why a test is skipped.
pub(crate) fn can_speak() -> bool {
    let can = Command::new(python())
        .args(["-c", "import cyclonedds"])
        .output()
        .is_ok_and(|output| output.status.success());
    if !can {
        println!(
            "skipped: {} has no package cyclonedds, or GYRE_PYTHON names another",
            python()
        );
    }
    can
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
    pub(crate) fn peer(script: &str, arguments: &[&str]) -> Self {
        let scripts = Path::new(crate::PROJECT).join("tests/reach/ros2");
        Self::start(
            Command::new(python())
                .arg(scripts.join(script))
                .args(arguments),
        )
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
        let topic = line["topic"].as_str().unwrap().to_owned();
        topics
            .entry(topic)
            .or_default()
            .push(line["message"].take());
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

/// A pose and its covariance as they are expected.
struct Expected {
    stamp_ns: i64,
    pose: UncertainMotion,
    /// The velocity, 0 at the first scan.
    velocity: [f64; 3],
    /// The covariance, if it was measured.
    covariance: Option<Matrix3<f64>>,
}

/// Returns each pose by `odometry.csv`: the motions composed with their covariances, after the
/// first scan's pose.
fn expected(run: &Run) -> Vec<Expected> {
    let names = [
        "stamp_ns",
        "interval_ns",
        "x_m",
        "y_m",
        "yaw_rad",
        "cov_xx",
        "cov_xy",
        "cov_xyaw",
        "cov_yy",
        "cov_yyaw",
        "cov_yawyaw",
        "drift_share",
        "scale_sigma",
        "outcome",
    ];
    let rows = odometry::columns(&run.odometry(), &names);
    let mut composed = ComposedMotion::new();
    let mut poses = Vec::new();
    for row in rows {
        let [stamp_ns, interval_ns] =
            [0, 1].map(|column: usize| row[column].parse::<i64>().unwrap());
        let at = |column: usize| row[column].parse::<f64>().unwrap();
        if poses.is_empty() {
            poses.push(Expected {
                stamp_ns: stamp_ns - interval_ns,
                pose: UncertainMotion::identity(),
                velocity: [0.0; 3],
                covariance: None,
            });
        }
        let motion = OdometryMotion {
            motion: pose(at(2), at(3), at(4)),
            covariance: covariance::unpack(&[5, 6, 7, 8, 9, 10].map(at)),
            drift_share: at(11),
            scale_sigma: at(12),
        };
        composed = composed.then(&motion);
        let interval_s = interval_ns as f64 * 1e-9;
        poses.push(Expected {
            stamp_ns,
            pose: composed.motion(),
            velocity: velocity([2, 3, 4].map(at), interval_s),
            covariance: (row[13] != "predicted")
                .then(|| velocity_covariance([2, 3, 4].map(at), &motion.covariance, interval_s)),
        });
    }
    poses
}

/// The constant velocity in the frame of the vehicle.
fn velocity([x_m, y_m, yaw_rad]: [f64; 3], interval_s: f64) -> [f64; 3] {
    let twist = gyre_geometry::Twist::from_motion(&pose(x_m, y_m, yaw_rad), interval_s);
    [twist.vx_mps, twist.vy_mps, twist.yaw_rate_radps]
}

/// The covariance of the velocity, from what small errors of the motion do to it.
fn velocity_covariance(
    motion: [f64; 3],
    covariance: &Matrix3<f64>,
    interval_s: f64,
) -> Matrix3<f64> {
    const STEP: f64 = 1e-5;
    let columns = [0, 1, 2].map(|value| {
        let [after, before] = [STEP, -STEP].map(|by| {
            let mut moved = motion;
            moved[value] += by;
            Vector3::from(velocity(moved, interval_s))
        });
        (after - before) / (2.0 * STEP)
    });
    let jacobian = Matrix3::from_columns(&columns);
    jacobian * covariance * jacobian.transpose()
}

/// Asserts that 36 numbers are a covariance of (x, y, yaw) in the order of ROS.
fn assert_covariance(found: &Value, planar: Option<&Matrix3<f64>>, what: &str) {
    for row in 0..6 {
        for column in 0..6 {
            let found = number(&found[6 * row + column]);
            let place = |value: usize| PLANAR.iter().position(|planar| *planar == value);
            let expected = match (planar, place(row), place(column)) {
                (Some(planar), Some(row), Some(column)) => planar[(row, column)],
                _ if row == column => UNKNOWN,
                _ => 0.0,
            };
            let limit = 1e-9 + 1e-5 * expected.abs();
            assert!(
                (found - expected).abs() <= limit,
                "{what} ({row}, {column}): {found}, expected {expected}"
            );
        }
    }
}

/// Asserts that odometry equals the results of the run, field by field.
fn assert_odometry(found: &[Value], run: &Run) {
    let poses = expected(run);
    assert_eq!(found.len(), poses.len());
    for (found, expected) in found.iter().zip(&poses) {
        assert_eq!(stamp_ns(&found["header"]), expected.stamp_ns);
        assert_eq!(
            (&found["header"]["frame_id"], &found["child_frame_id"]),
            (&"odom".into(), &"base_link".into())
        );
        let place = &found["pose"]["pose"];
        let [x_m, y_m, yaw_rad] = gyre_geometry::xy_yaw(&expected.pose.motion);
        let turn = &place["orientation"];
        let found_yaw = 2.0 * number(&turn["z"]).atan2(number(&turn["w"]));
        for (found, expected) in [
            (number(&place["position"]["x"]), x_m),
            (number(&place["position"]["y"]), y_m),
            (gyre_geometry::wrap_angle(found_yaw - yaw_rad), 0.0),
            (number(&place["position"]["z"]), 0.0),
            (number(&turn["x"]), 0.0),
            (number(&turn["y"]), 0.0),
        ] {
            // Rounding of the file, composed.
            assert!(
                (found - expected).abs() < 1e-5,
                "{}: {found} {expected}",
                poses.len()
            );
        }
        assert_covariance(
            &found["pose"]["covariance"],
            Some(&expected.pose.covariance),
            "pose",
        );
        let twist = &found["twist"]["twist"];
        let found_velocity = [
            &twist["linear"]["x"],
            &twist["linear"]["y"],
            &twist["angular"]["z"],
        ]
        .map(number);
        for (found, expected) in found_velocity.iter().zip(expected.velocity) {
            assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        }
        assert_covariance(
            &found["twist"]["covariance"],
            expected.covariance.as_ref(),
            "twist",
        );
    }
}

/// The transforms of a topic as the frames that they are between, with each pose.
pub(crate) fn transforms(messages: &[Value]) -> Vec<(i64, String, [f64; 4])> {
    let all = messages
        .iter()
        .flat_map(|message| message["transforms"].as_array().unwrap());
    all.map(|it| {
        let frames = format!(
            "{} -> {}",
            it["header"]["frame_id"].as_str().unwrap(),
            it["child_frame_id"].as_str().unwrap()
        );
        let (place, turn) = (
            &it["transform"]["translation"],
            &it["transform"]["rotation"],
        );
        let values = [&place["x"], &place["y"], &turn["z"], &turn["w"]].map(number);
        (stamp_ns(&it["header"]), frames, values)
    })
    .collect()
}

#[test]
fn a_node_of_ros_receives_each_pose_with_its_stamp_frames_and_covariance() {
    if !can_speak() {
        return;
    }
    // The queue holds four seconds, should the bridge be late.
    let run = Run::of_recording().rate("1");
    let domain = domain(0);
    let bridge = Program::bridge(&run, &domain, &["--mounting", "0,0,0"]);
    let peer = Program::peer("observer.py", &[&domain, "/"]);
    let undisturbed = run.complete();
    let topics = received(peer);
    let said = bridge.interrupt();
    assert!(
        said.iter()
            .any(|line| line.contains("0 poses missed; 0 messages not sent")),
        "{said:?}"
    );

    assert_odometry(&topics["/odom"], &run);
    assert_eq!(
        Run::of_recording().complete(),
        undisturbed,
        "an observer changed the result"
    );
    let of_poses = transforms(&topics["/tf"]);
    assert_eq!(of_poses.len(), topics["/odom"].len());
    for ((stamp, frames, values), odometry) in of_poses.iter().zip(&topics["/odom"]) {
        let (place, turn) = (
            &odometry["pose"]["pose"]["position"],
            &odometry["pose"]["pose"]["orientation"],
        );
        assert_eq!(
            (*stamp, frames.as_str()),
            (stamp_ns(&odometry["header"]), "odom -> base_link")
        );
        assert_eq!(
            *values,
            [&place["x"], &place["y"], &turn["z"], &turn["w"]].map(number)
        );
    }
    let [(_, frames, values)] = &transforms(&topics["/tf_static"])[..] else {
        panic!("{:?}", topics["/tf_static"]);
    };
    assert_eq!(
        (frames.as_str(), *values),
        ("base_link -> radar", [0.0, 0.0, 0.0, 1.0])
    );
    assert!(
        !topics.contains_key("/map"),
        "a run without SLAM has no map"
    );
    assert!(
        !topics.contains_key("/objects"),
        "a run that tracks no objects publishes none"
    );
    let parts: Vec<_> = topics["/diagnostics"]
        .iter()
        .flat_map(|it| it["status"].as_array().unwrap())
        .collect();
    let is_well = |name: &str| {
        parts
            .iter()
            .any(|part| part["name"] == name && part["level"] == 0)
    };
    assert!(is_well("gyre") && is_well("gyre: masking"), "{parts:?}");
}

/// As `robot_localization` needs it, which publishes the transform of odometry itself and predicts
/// where nothing was measured.
#[test]
fn a_filter_can_have_its_own_transforms_and_sees_which_velocities_are_predicted() {
    if !can_speak() {
        return;
    }
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
