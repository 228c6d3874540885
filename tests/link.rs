//! A run that is split between two machines gives the same results, whatever happens to the link; and one can look on from another machine.

use std::{
    fs,
    net::TcpListener,
    path::{Path, PathBuf},
    process::{self, Command},
    thread,
    time::Duration,
};

use crate::common::{Ended, Run, gyre, recording, undisturbed, wrapped};

/// Time for which the link is cut: longer than the time after which a connection is given up.
const CUT: Duration = Duration::from_secs(5);

/// One side of a run of the small recording, which the robot has.
fn side(side: &str, cut: &str, endpoint: &str) -> Run {
    let run = match side {
        "robot" => Run::of_recording(),
        _ => Run::small(),
    };
    run.set(&format!("link.side='{side}'"))
        .set(&format!("link.cut='{cut}'"))
        .set(endpoint)
}

/// Both sides over a free port of this machine: the base, and the robot.
fn sides(cut: &str) -> [Run; 2] {
    let address = endpoint();
    [
        side("base", cut, &format!("link.listen=['{address}']")),
        side("robot", cut, &format!("link.connect=['{address}']")),
    ]
}

fn endpoint() -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    format!("tcp/{}", listener.local_addr().unwrap())
}

/// Runs both sides to their ends, and returns what both have.
fn complete([base, robot]: [Run; 2]) -> [String; 2] {
    let running = [base.start(), robot.start()];
    for running in running {
        running.finish().succeeded();
    }
    [base.odometry(), robot.odometry()]
}

#[test]
fn a_run_that_is_split_anywhere_has_the_same_results_on_both_sides() {
    for cut in ["scan", "masked", "rotation", "motion", "refined"] {
        for odometry in complete(sides(cut)) {
            assert!(odometry == undisturbed(), "cut at {cut}");
        }
    }
}

#[test]
fn a_split_run_goes_on_after_a_death_of_any_process_on_either_side() {
    let [base, robot] = sides("rotation").map(|side| side.set("run.window=2"));
    let robot = robot.rate("2");
    let (mut there, mut here) = (base.start(), robot.start());
    for (poses, stage) in [(3, "pose-integration"), (7, "masking")] {
        here.await_poses(poses).kill(stage);
    }
    for (poses, stage) in [(10, "radar-replay"), (13, "pose-integration")] {
        there.await_poses(poses).kill(stage);
    }
    // The robot's whole side begins again, and goes on.
    here.await_poses(16);
    here.kill_supervisor();
    robot.start().finish().succeeded();
    there.finish().succeeded();
    assert!(base.odometry() == undisturbed());
    assert!(robot.odometry() == undisturbed());
}

#[test]
fn a_robot_that_begins_anew_is_given_what_the_base_has() {
    let [base, robot] = sides("masked");
    let robot = robot.rate("2");
    let there = base.start();
    let mut here = robot.start();
    here.await_poses(8);
    here.kill_supervisor();
    robot.option("--fresh").start().finish().succeeded();
    there.finish().succeeded();
    assert!(base.odometry() == undisturbed());
}

#[test]
fn sides_that_do_not_fit_refuse_each_other() {
    let [base, robot] = sides("masked");
    let _there = base.start();
    let ended = robot.set("raster.n=63").finish();
    ended.failed_with(&["raster.n is 63 on the robot and 127 on the base"]);
}

#[test]
fn a_link_off_this_machine_needs_certificates() {
    let refused = |sentence: &str, words: &[&str]| {
        let run = side("robot", "masked", sentence);
        run.finish().refused_with(words);
    };
    refused(
        "link.connect=['tcp/192.0.2.1:7447']",
        &["unencrypted", "tls/"],
    );
    refused("link.listen=['tls/0.0.0.0:7447']", &["certificate"]);
    refused("link.listen=[]", &["no endpoint"]);
    let live = side("base", "scan", "link.listen=['tcp/127.0.0.1:7447']").set("run.mode=live");
    live.finish().refused_with(&["link", "masking sheds load"]);
    let mut command = gyre();
    command.args(["link", "send", "out", "--listen", "tcp/0.0.0.0:7447"]);
    Ended::of(command).refused_with(&["unencrypted"]);
}

#[test]
fn another_machine_sees_all_poses_of_a_run_from_its_beginning() {
    let run = Run::of_recording().rate("1");
    let mut running = run.start();
    running.await_poses(6);
    let (address, seen) = (endpoint(), run.folder().join("seen"));
    let link = |end: &str, out: &Path, option: &str| {
        let mut command = gyre();
        command
            .args(["link", end])
            .arg(out)
            .args([option, &address]);
        command
    };
    let mut send = link("send", run.out(), "--listen");
    send.args(["--topics", "scan,motion,refined,pose"]);
    let sending = thread::spawn(move || Ended::of(send));
    let received = Ended::of(link("receive", &seen, "--connect"));
    received.succeeded();
    running.finish().succeeded();
    let scans = recording::SCANS;
    for topic in ["pose", "refined"] {
        let words = format!("{scans} {topic}");
        assert!(received.stderr.contains(&words), "{}", received.stderr);
    }
    // Of scans that were gone before it came it knows nothing; of those between it does.
    assert!(received.stderr.contains(" scan"), "{}", received.stderr);
    sending.join().unwrap().succeeded();
    let poses = |out: &Path| {
        fs::read(gyre_pose_integration::journal::path(out))
            .unwrap()
            .len()
    };
    assert!(
        poses(&seen) > 0 && poses(&seen) < poses(run.out()),
        "all but the end"
    );
}

#[test]
fn a_cut_of_five_seconds_between_two_machines_loses_nothing() {
    let Some(machines) = Machines::new() else {
        return;
    };
    let base = side("base", "masked", &machines.endpoint("listen"));
    let robot = side("robot", "masked", &machines.endpoint("connect")).rate("2");
    let [base, robot] = [base, robot].map(|side| machines.with_certificates(side));
    let (mut there, here) = (machines.start(0, &base), machines.start(1, &robot));
    there.await_poses(6);
    machines.set_link("down");
    thread::sleep(CUT / 2);
    let poses = there.poses();
    thread::sleep(CUT / 2);
    assert_eq!(there.poses(), poses, "nothing comes while the link is cut");
    machines.set_link("up");
    here.finish().succeeded();
    there.finish().succeeded();
    assert!(poses < recording::SCANS, "it had not ended before");
    assert!(base.odometry() == undisturbed());
    assert!(robot.odometry() == undisturbed());
}

/// Two machines: network namespaces with a cable between them, and certificates of both.
struct Machines {
    names: [String; 2],
    subnet: String,
    folder: tempfile::TempDir,
}

impl Machines {
    /// Says so and returns `None` where that is not permitted.
    fn new() -> Option<Self> {
        let id = process::id() % 65536;
        let machines = Self {
            names: ["a", "b"].map(|end| format!("gy{id:x}{end}")),
            subnet: format!("10.{}.{}", 64 + id / 256 % 128, id % 256),
            folder: crate::common::folder(),
        };
        let [a, b] = &machines.names;
        let made = [a, b].iter().all(|name| ip(&["netns", "add", name]))
            && ip(&[
                "link", "add", a, "netns", a, "type", "veth", "peer", "name", b, "netns", b,
            ])
            && [(a, 1), (b, 2)].iter().all(|(name, end)| {
                let address = format!("{}.{end}/24", machines.subnet);
                ip(&["-n", name, "addr", "add", &address, "dev", name])
                    && ip(&["-n", name, "link", "set", "lo", "up"])
                    && ip(&["-n", name, "link", "set", name, "up"])
            });
        if !made {
            println!("skipped: network namespaces need root and iproute2");
            return None;
        }
        machines.make_certificates();
        Some(machines)
    }

    /// As docs/link.md has it.
    fn make_certificates(&self) {
        let script = r#"
            set -e
            openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 3650 -subj /CN=gyre-link -keyout ca.key -out ca.pem
            for side in base:IP:$1.1 robot:IP:$1.2; do
                name=${side%%:*}
                openssl req -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -subj /CN=$name -keyout $name.key -out $name.csr
                printf 'subjectAltName=%s\nextendedKeyUsage=serverAuth,clientAuth\n' ${side#*:} > $name.ext
                openssl x509 -req -in $name.csr -CA ca.pem -CAkey ca.key -CAcreateserial -days 825 -extfile $name.ext -out $name.pem
            done"#;
        let mut command = Command::new("sh");
        command.args(["-c", script, "sh", &self.subnet]);
        Ended::of({
            command.current_dir(self.folder.path());
            command
        })
        .succeeded();
    }

    fn with_certificates(&self, side: Run) -> Run {
        let file = |name: String| -> PathBuf { self.folder.path().join(name) };
        let base = side.command().get_args().any(|it| it == "link.side='base'");
        let name = if base { "base" } else { "robot" };
        [
            ("ca", file("ca.pem".to_owned())),
            ("certificate", file(format!("{name}.pem"))),
            ("key", file(format!("{name}.key"))),
        ]
        .into_iter()
        .fold(side, |side, (key, path)| {
            side.set(&format!("link.{key}='{}'", path.display()))
        })
    }

    /// The first of the machines is the one that listens.
    fn endpoint(&self, key: &str) -> String {
        format!("link.{key}=['tls/{}.1:7447']", self.subnet)
    }

    fn start(&self, machine: usize, run: &Run) -> crate::common::Running {
        let inside = ["ip", "netns", "exec", &self.names[machine]];
        run.start_as(wrapped(&inside, &run.command()))
    }

    /// Pulls the cable at one end, or plugs it in.
    fn set_link(&self, state: &str) {
        let [a, _] = &self.names;
        assert!(ip(&["-n", a, "link", "set", a, state]));
    }
}

impl Drop for Machines {
    fn drop(&mut self) {
        for name in &self.names {
            ip(&["netns", "del", name]);
        }
    }
}

/// Returns whether `ip` has done it.
fn ip(arguments: &[&str]) -> bool {
    let done = Command::new("ip").args(arguments).output();
    done.is_ok_and(|output| output.status.success())
}
