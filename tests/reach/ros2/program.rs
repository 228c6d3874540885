//! The programs of the tests of ROS 2: the bridge, nodes, and peers on Cyclone DDS.

use std::{
    collections::BTreeMap,
    env,
    io::{BufRead, BufReader, Write},
    mem,
    process::{self, Child, Command, Stdio},
    sync::mpsc::{Receiver, channel},
    thread,
    time::{Duration, Instant},
};

use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

use crate::{
    PROJECT,
    common::{Run, can, gyre, script},
    reach::python_has,
};

/// The longest wait for a line of a program.
const LIMIT: Duration = Duration::from_secs(90);

/// Returns whether the peer can be started; prints why a test is skipped.
pub(crate) fn can_speak() -> bool {
    python_has("cyclonedds")
}

/// The Python with the packages of `reach/ros2/requirements.txt`: it starts itself again with other
/// libraries, so that it has an environment of its own.
fn python_of_ros() -> String {
    env::var("GYRE_ROS_PYTHON").unwrap_or_else(|_| "python3".to_owned())
}

/// Returns whether a node of ROS 2 can be started; prints why a test is skipped.
pub(crate) fn has_ros() -> bool {
    can(&[&python_of_ros(), "-c", "import rclpy"])
}

/// A domain that only this test of this process uses, of 20. Those above 101 share their ports with
/// other programs.
pub(crate) fn domain(test: u32) -> String {
    (1 + (process::id() % 5) * 20 + test).to_string()
}

/// The time for a program to end after Ctrl-C.
const TO_END: Duration = Duration::from_secs(5);

/// A program that prints lines. Dropped, it is ended: a node of Fast DDS that is killed leaves
/// files in shared memory.
pub(crate) struct Program {
    child: Child,
    /// The lines so far, read as they come: a program whose output is full would wait.
    said: Receiver<String>,
    kept: Vec<String>,
}

impl Program {
    /// Starts the program, and waits for its first line.
    pub(crate) fn start(command: &mut Command) -> Self {
        let command = command.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let (to, said) = channel();
        thread::spawn(move || {
            lines
                .map_while(Result::ok)
                .try_for_each(|line| to.send(line))
        });
        said.recv().expect("it has ended");
        Self {
            child,
            said,
            kept: Vec::new(),
        }
    }

    /// A peer in Python.
    pub(crate) fn peer(name: &str, arguments: &[&str]) -> Self {
        Self::start(script(&format!("reach/ros2/{name}")).args(arguments))
    }

    /// A node of ROS 2 that reads the topics of the run in a namespace.
    pub(crate) fn node(domain: &str, arguments: &[&str]) -> Self {
        let mut command = Command::new(python_of_ros());
        command.arg(format!("{PROJECT}/tests/reach/ros2/node.py"));
        Self::start(on_loopback(command.args(arguments), domain))
    }

    /// A bridge that waits for the run. Its sentences for the terminal count as its lines.
    pub(crate) fn bridge(run: &Run, domain: &str, options: &[&str]) -> Self {
        let mut command = Command::new("sh");
        command.args(["-c", "exec \"$@\" 2>&1", "sh"]);
        command.arg(gyre().get_program()).arg("ros2").arg(run.out());
        Self::start(on_loopback(command.arg("--wait").args(options), domain))
    }

    /// Waits for a line with these words. The lines up to there stay in its output.
    pub(crate) fn await_words(&mut self, words: &str) -> String {
        let limit = Instant::now() + LIMIT;
        loop {
            let left = limit.saturating_duration_since(Instant::now());
            let line = self.said.recv_timeout(left);
            let line = line.unwrap_or_else(|error| panic!("`{words}`: {error}"));
            self.kept.push(line.clone());
            if line.contains(words) {
                return line;
            }
        }
    }

    /// Waits until a bridge has published the whole run.
    pub(crate) fn await_end(&mut self) -> String {
        self.await_words("the run has ended")
    }

    pub(crate) fn write(&mut self, line: &str) {
        let input = self.child.stdin.as_mut().unwrap();
        writeln!(input, "{line}").unwrap();
    }

    /// Closes the input of the program, and returns its output up to its end.
    pub(crate) fn rest(mut self) -> Vec<String> {
        drop(self.child.stdin.take());
        self.kept.extend(self.said.iter());
        assert!(self.child.wait().unwrap().success());
        mem::take(&mut self.kept)
    }

    /// Ends the program as Ctrl-C does.
    pub(crate) fn interrupt(self) {
        let pid = Pid::from_child(&self.child);
        kill_process(pid, Signal::INT).unwrap();
        self.rest();
    }
}

/// Keeps a program of ROS 2 in a domain of this computer, by the variables of ROS 2.
fn on_loopback<'a>(command: &'a mut Command, domain: &str) -> &'a mut Command {
    command.env("ROS_DOMAIN_ID", domain);
    command.env("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
}

impl Drop for Program {
    fn drop(&mut self) {
        let limit = Instant::now() + TO_END;
        let _ = kill_process(Pid::from_child(&self.child), Signal::INT);
        while let Ok(None) = self.child.try_wait()
            && Instant::now() < limit
        {
            thread::sleep(Duration::from_millis(20));
        }
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
