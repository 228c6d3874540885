//! A run that is split between two machines gives the same results, whatever happens to the link;
//! and one can look on from another machine.

use std::{
    io::{Read, Write},
    net::{Shutdown, TcpListener, TcpStream},
    path::{Path, PathBuf},
    process::Command,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::Duration,
};

use crate::common::{
    Ended, Run, Spawned, finished, gyre, poses_of, recording, undisturbed, wrapped,
};

/// Time for which the link is cut: longer than the time after which a connection is given up.
const CUT: Duration = Duration::from_secs(5);

/// One side of a run of the small recording, which the robot has.
fn side(side: &str, cut: &str, endpoint: &str) -> Run {
    let run = match side {
        "robot" => Run::of_recording(),
        _ => Run::small(),
    };
    run.sets(&format!("link.side='{side}' link.cut='{cut}' {endpoint}"))
}

/// Both sides over a free port of this machine: the base, and the robot.
fn sides(cut: &str) -> [Run; 2] {
    let address = endpoint();
    [
        side("base", cut, &format!("link.listen=['{address}']")),
        side("robot", cut, &format!("link.connect=['{address}']")),
    ]
}

/// Returns an address that stays free: those who connect take their ports on 127.0.0.1.
fn endpoint() -> String {
    let listener = TcpListener::bind("127.0.0.2:0").unwrap();
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
    // The robot's whole side begins again, and continues.
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
    let here = robot.started(8);
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
    let plain = side("robot", "masked", "link.connect=['tcp/192.0.2.1:7447']");
    plain.finish().refused_with(&["unencrypted", "tls/"]);
    let live = side("base", "scan", "link.listen=['tcp/127.0.0.1:7447']").set("run.mode=live");
    live.finish().refused_with(&["link", "masking sheds load"]);
    finished!["link", "send", "out", "--listen", "tcp/0.0.0.0:7447"].refused_with(&["unencrypted"]);
}

#[test]
fn a_robot_that_plays_another_drive_is_refused() {
    let address = endpoint();
    let there = side("base", "motion", &format!("link.listen=['{address}']"));
    let _there = there.start();
    let other = recording::linked(recording::small(), |scan| scan > 3);
    let [first, second] = [recording::small(), other.path()].map(|data| {
        let robot = Run::small().data(data).rate("2");
        robot.sets(&format!(
            "link.side='robot' link.cut='motion' link.connect=['{address}']"
        ))
    });
    let here = first.started(6);
    here.kill_supervisor();
    let ended = second.finish();
    ended.failed_with(&["the base has poses of a different drive", "--fresh"]);
    // The next run removes the leftovers of the killed one.
    first.option("--fresh").finish().succeeded();
}

#[test]
fn another_machine_sees_all_poses_of_a_run_from_its_beginning() {
    let run = Run::of_recording().rate("1");
    let running = run.started(6);
    let link = Link::new();
    let seen = run.folder().join("seen");
    let mut send = link.end("send", run.out());
    send.args(["--topics", "scan,motion,refined,pose"]);
    let sending = thread::spawn(move || Ended::of(send));
    let received = Ended::of(link.end("receive", &seen));
    received.succeeded();
    running.finish().succeeded();
    let scans = recording::SCANS;
    for topic in ["pose", "refined"] {
        let said = &received.stderr;
        let is_listed = |before| said.contains(&format!("{before}{scans} {topic}"));
        assert!(is_listed("received ") || is_listed(", "), "{said}");
    }
    // Of scans that were gone before it came it knows nothing; of those between it does.
    let (received_part, _) = received.stderr.split_once("; missed").unwrap();
    assert!(received_part.contains(" scan"), "{}", received.stderr);
    sending.join().unwrap().succeeded();
    assert_eq!(poses_of(&seen) + 1, poses_of(run.out()), "all but the end");
}

#[test]
fn a_sender_that_begins_again_is_gone_on_with() {
    let run = Run::of_recording().rate("0.4");
    let running = run.started(3);
    let link = Link::new();
    let receiving = link.lose_sender(&run);
    let second = link.start("send", run.out());
    running.finish().succeeded();
    let received = receiving.join().unwrap();
    let all = format!("{} pose", recording::SCANS);
    received.succeeded().says(&all);
    second.join().unwrap().succeeded();
}

#[test]
fn another_drive_is_not_put_behind_the_one_that_was_received() {
    let run = Run::of_recording().rate("0.4");
    let running = run.started(3);
    let link = Link::new();
    let receiving = link.lose_sender(&run);
    running.kill_supervisor();
    let other = recording::linked(recording::small(), |scan| scan > 3);
    let later = Run::small().data(other.path()).rate("0.4");
    let running = later.started(3);
    let _second = link.sender(&later);
    let received = receiving.join().unwrap();
    received.failed_with(&["the sender plays a different drive now"]);
    running.finish().succeeded();
}

#[test]
fn nobody_connects_without_a_certificate_of_the_authority() {
    let (ours, theirs) = (Certificates::new(), Certificates::new());
    let run = Run::of_recording().rate("0.2");
    let running = run.started(2);
    let address = endpoint().replace("tcp/", "tls/");
    let link = Link { address };
    let sends = |certificates: &Certificates| {
        let mut send = link.end("send", run.out());
        certificates.give(&mut send, "base", ours.path("ca.pem"));
        Spawned::new(send, run.folder().join("sender"))
    };
    let receives = |certificates: &Certificates, seconds: &str| {
        let seen = run.folder().join("seen");
        let mut receive = link.end("receive", &seen);
        certificates.give(&mut receive, "robot", ours.path("ca.pem"));
        let interrupted = ["timeout", "-s", "INT", seconds];
        Ended::of(wrapped(&interrupted, &receive)).stderr
    };
    for (sender, receiver, seconds, expected) in [
        (&ours, &theirs, "4", false),
        (&theirs, &ours, "4", false),
        (&ours, &ours, "20", true),
    ] {
        let _sender = sends(sender);
        let said = receives(receiver, seconds);
        assert_eq!(said.contains("is here as"), expected, "{said}");
    }
    running.kill_supervisor();
}

struct Link {
    address: String,
}

impl Link {
    fn new() -> Self {
        let address = endpoint();
        Self { address }
    }

    fn end(&self, end: &str, out: &Path) -> Command {
        let mut command = gyre();
        command.args(["link", end]).arg(out);
        let option = match end {
            "send" => "--listen",
            _ => "--connect",
        };
        command.args([option, &self.address]);
        command
    }

    /// Starts a receiver of a run, whose sender is killed when poses have come.
    fn lose_sender(&self, run: &Run) -> thread::JoinHandle<Ended> {
        let seen = run.folder().join("seen");
        let sender = self.sender(run);
        let receiving = self.start("receive", &seen);
        sender.until(|_| (poses_of(&seen) > 1).then_some(()));
        receiving
    }

    fn sender(&self, run: &Run) -> Spawned {
        Spawned::new(self.end("send", run.out()), run.folder().join("sender"))
    }

    fn start(&self, end: &str, out: &Path) -> thread::JoinHandle<Ended> {
        let command = wrapped(&["timeout", "120"], &self.end(end, out));
        thread::spawn(move || Ended::of(command))
    }
}

#[test]
fn a_cut_of_five_seconds_between_both_sides_loses_nothing() {
    let [there, cut] = [endpoint(), endpoint()];
    let base = side("base", "masked", &format!("link.listen=['{there}']"));
    let robot = side("robot", "masked", &format!("link.connect=['{cut}']")).rate("2");
    let cable = Cable::between(&cut, &there);
    let (mut there, here) = (base.start(), robot.start());
    there.await_poses(6);
    cable.set_cut(true);
    thread::sleep(CUT / 2);
    let poses = there.poses();
    thread::sleep(CUT / 2);
    assert_eq!(there.poses(), poses, "nothing comes while the link is cut");
    cable.set_cut(false);
    here.finish().succeeded();
    there.finish().succeeded();
    assert!(poses < recording::SCANS, "it had not ended before");
    assert!(base.odometry() == undisturbed());
    assert!(robot.odometry() == undisturbed());
}

/// Passes bytes between those who connect to it and an address; while it is cut, they wait in
/// silence.
struct Cable {
    is_cut: Arc<AtomicBool>,
}

impl Cable {
    fn between(here: &str, there: &str) -> Self {
        let [here, there] = [here, there].map(|address| address.replace("tcp/", ""));
        let listener = TcpListener::bind(here).unwrap();
        let is_cut = Arc::new(AtomicBool::new(false));
        let cable = Self {
            is_cut: is_cut.clone(),
        };
        // It ends with the process of the tests.
        thread::spawn(move || {
            for here in listener.incoming().flatten() {
                let Ok(there) = TcpStream::connect(&there) else {
                    continue;
                };
                for (from, to) in [(&here, &there), (&there, &here)] {
                    let [from, to] = [from, to].map(|end| end.try_clone().unwrap());
                    let is_cut = is_cut.clone();
                    thread::spawn(move || pass(from, to, &is_cut));
                }
            }
        });
        cable
    }

    fn set_cut(&self, is_cut: bool) {
        self.is_cut.store(is_cut, Ordering::Relaxed);
    }
}

fn pass(mut from: TcpStream, mut to: TcpStream, is_cut: &AtomicBool) {
    let mut bytes = [0; 1 << 16];
    while let Ok(count @ 1..) = from.read(&mut bytes) {
        while is_cut.load(Ordering::Relaxed) {
            thread::sleep(Duration::from_millis(10));
        }
        if to.write_all(&bytes[..count]).is_err() {
            break;
        }
    }
    let _ = to.shutdown(Shutdown::Both);
}

/// An authority, and the certificates that it has signed for a base and a robot.
struct Certificates {
    folder: tempfile::TempDir,
}

impl Certificates {
    /// Makes them as docs/link.md has it, for both sides on this machine.
    fn new() -> Self {
        let script = r#"
            set -e
            openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 3650 -subj /CN=gyre-link -keyout ca.key -out ca.pem
            for name in base robot; do
                openssl req -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -subj /CN=$name -keyout $name.key -out $name.csr
                printf 'subjectAltName=IP:127.0.0.2\nextendedKeyUsage=serverAuth,clientAuth\n' > $name.ext
                openssl x509 -req -in $name.csr -CA ca.pem -CAkey ca.key -CAcreateserial -days 825 -extfile $name.ext -out $name.pem
            done"#;
        let folder = crate::common::folder();
        let mut command = Command::new("sh");
        command.args(["-c", script]).current_dir(folder.path());
        Ended::of(command).succeeded();
        Self { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Has an end of a link show the certificate of a side, and believe an authority.
    fn give(&self, command: &mut Command, side: &str, ca: PathBuf) {
        command.arg("--ca").arg(ca);
        let certificate = self.path(&format!("{side}.pem"));
        command.arg("--certificate").arg(certificate);
        command.arg("--key").arg(self.path(&format!("{side}.key")));
    }
}
