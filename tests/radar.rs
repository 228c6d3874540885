//! A radar on the network: `gyre radar-server` plays a recording as one, and a run receives it live.

use std::{
    io::{BufRead, BufReader},
    net::UdpSocket,
    path::Path,
    process::{self, Child, Stdio},
    sync::mpsc::{self, RecvTimeoutError},
    thread,
    time::Duration,
};

use crate::common::{Ended, Run, gyre, odometry, recording};

/// Faster than the radar turns, and slow enough for a run to keep up.
const RATE: &str = "1.5";

/// A radar on a port of its own, which is switched off when it is dropped.
struct Radar {
    server: Child,
    address: String,
}

impl Radar {
    fn playing(recording: &Path, arguments: &[&str]) -> Self {
        Self::to(&["--listen", "127.0.0.1:0"], recording, arguments)
    }

    /// One that sends to a group by UDP, and describes only itself for as long as a run takes to begin.
    fn sending(group: &str, recording: &Path, arguments: &[&str]) -> Self {
        Self::to(&["--udp", group, "--wait-s", "4"], recording, arguments)
    }

    fn to(whom: &[&str], recording: &Path, arguments: &[&str]) -> Self {
        let mut command = gyre();
        command.arg("radar-server").args(whom);
        command.args(["--rate", RATE, "--data"]);
        command.arg(recording).args(arguments);
        let mut server = command
            .stderr(Stdio::piped())
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        let mut said = String::new();
        let mut words = BufReader::new(server.stderr.take().unwrap());
        words.read_line(&mut said).unwrap();
        let address = said.trim().rsplit(' ').next().unwrap().to_owned();
        Self { server, address }
    }

    /// A run that receives so many scans of it, with the constants that the recording has in its `dataset.toml`.
    fn run(&self, scans: usize) -> Run {
        let settings = std::fs::read_to_string(recording::small().join("dataset.toml")).unwrap();
        let settings: toml::Table = settings.parse().unwrap();
        let run = Run::small().argument("--radar", &self.address);
        let known = settings.iter().filter(|(key, _)| *key != "format");
        known
            .fold(run, |run, (key, value)| {
                run.set(&format!("dataset.{key}={value}"))
            })
            .set(&format!("source.scans={scans}"))
            .set("source.silence_s=1")
    }

    /// As [`Radar::run`] on the loopback's network.
    fn received(&self, scans: usize) -> Run {
        self.run(scans).set("source.interface='127.0.0.1'")
    }
}

impl Drop for Radar {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

#[test]
fn a_radar_gives_the_motions_of_its_recording() {
    let scans = recording::SCANS / 2;
    let whole = recording::copy(scans);
    for image in recording::images(whole.path()) {
        recording::complete(&image);
    }
    let recorded = Run::small().data(whole.path()).complete();
    for clock in [&[][..], &["--big-endian"]] {
        let radar = Radar::playing(whole.path(), clock);
        let run = radar.run(scans);
        let live = run.complete();
        assert_eq!(run.summary()["dropped"], 0);
        let source = &run.summary()["stages"]["radar-replay"];
        assert_eq!(source["missing_azimuths"], 0);
        assert!(live == recorded, "{clock:?}:\n{live}\n{recorded}");
    }
}

/// A group that only this test of this process sends to.
fn group(test: u8) -> String {
    let port = 20_000 + process::id() % 20_000;
    format!("239.192.43.{test}:{port}")
}

/// The rows of an odometry without the numbers of items and scans.
fn motions(odometry: &str) -> Vec<&str> {
    let rows = odometry.lines().skip(1);
    rows.map(|row| row.splitn(4, ',').last().unwrap()).collect()
}

#[test]
fn datagrams_give_the_motions_of_the_recording() {
    let whole = recording::copy(recording::SCANS);
    for image in recording::images(whole.path()) {
        recording::complete(&image);
    }
    let scans = recording::SCANS / 2;
    let arguments = ["--double", "0.05", "--repeat"];
    let radar = Radar::sending(&group(1), whole.path(), &arguments);
    let run = radar.received(scans);
    let live = run.complete();
    let source = &run.summary()["stages"]["radar-replay"];
    assert_eq!(source["missing_azimuths"], 0, "{source}");
    assert_eq!(source["damaged_messages"], 0, "{source}");
    assert_eq!(run.summary()["dropped"], 0);
    // On a busy machine the radar may have begun before the run.
    let all = Run::small().data(whole.path()).complete();
    let stamps = |csv| odometry::columns(csv, &["stamp_ns", "previous_scan"]);
    let begun = &stamps(&live)[0][0];
    let all = stamps(&all);
    let first = &all.iter().find(|row| row[0] == *begun).unwrap()[1];
    let recorded = Run::small()
        .data(whole.path())
        .set(&format!("source.first={first}"))
        .set(&format!("source.scans={scans}"));
    assert_eq!(motions(&live), motions(&recorded.complete()));
}

#[test]
fn lost_doubled_and_swapped_datagrams_are_lost_azimuths_at_most() {
    let faults = [
        "--lose",
        "0.005",
        "--double",
        "0.01",
        "--swap",
        "0.01",
        "--garbage-every",
        "5",
        "--repeat",
    ];
    let radar = Radar::sending(&group(2), recording::small(), &faults);
    let run = radar.received(20);
    run.complete();
    let summary = run.summary();
    let source = &summary["stages"]["radar-replay"];
    let count = |key: &str| source[key].as_u64().unwrap();
    // A two-hundredth of the parts of 20 x 400 azimuths, and those parts that came after the next azimuth.
    assert!((20..1000).contains(&count("missing_azimuths")), "{source}");
    assert!((2..10).contains(&count("damaged_messages")), "{source}");
    assert_eq!(count("reconnections"), 0, "{source}");
    assert_eq!(summary["published"], 20);
}

#[test]
fn datagrams_without_scans_are_named_in_a_sentence() {
    let to = group(3);
    let run = Run::small()
        .argument("--radar", &format!("udp://{to}"))
        .set("source.interface='127.0.0.1'");
    let sender = UdpSocket::bind("127.0.0.1:0").unwrap();
    let (stop, stopped) = mpsc::channel::<()>();
    let sending = thread::spawn(move || {
        while stopped.recv_timeout(Duration::from_millis(50)) == Err(RecvTimeoutError::Timeout) {
            // Navtech's point cloud, without points.
            sender.send_to(&[2, 40, 0, 0, 0, 0, 0, 0], &to).unwrap();
        }
    });
    Ended::of(run.command()).refused_with(&["are no scans", "data output to CAT-240"]);
    drop(stop);
    sending.join().unwrap();
    let run = Run::small().argument("--radar", "udp://239.192.43.3");
    Ended::of(run.command()).refused_with(&["`udp://239.192.43.3` is none for datagrams"]);
}

#[test]
fn every_fault_of_a_radar_is_counted_and_none_ends_the_run() {
    let faults = [
        "--lose",
        "0.01",
        "--reset-every",
        "7",
        "--garbage-every",
        "5",
        "--stall-every",
        "11",
        "--stall-s",
        "1.5",
    ];
    let radar = Radar::playing(recording::small(), &[&faults[..], &["--repeat"]].concat());
    let run = radar.run(30);
    run.complete();
    let summary = run.summary();
    let source = &summary["stages"]["radar-replay"];
    let count = |key: &str| source[key].as_u64().unwrap();
    assert!(
        (60..240).contains(&count("missing_azimuths")),
        "a hundredth of 30 x 400: {source}"
    );
    assert!(count("reconnections") >= 4, "{source}");
    assert!(count("damaged_messages") >= 4, "{source}");
    let [published, processed, dropped] =
        ["published", "processed", "dropped"].map(|key| summary[key].as_u64().unwrap());
    assert_eq!((published, processed + dropped), (30, 30));
}

#[test]
fn the_source_can_die_and_receives_again() {
    let radar = Radar::playing(recording::small(), &["--repeat"]);
    let run = radar.run(20);
    let mut running = run.start();
    running.await_poses(5).kill("radar-replay");
    running.finish().succeeded();
    let summary = run.summary();
    assert_eq!(summary["restarts"]["radar-replay"], 1);
    assert_eq!(summary["published"], 20);
    odometry::assert_unbroken(&odometry::rows(&run.odometry()));
}

#[test]
fn an_interrupted_run_goes_on_with_the_same_command() {
    let radar = Radar::playing(recording::small(), &["--repeat"]);
    let run = radar.run(20);
    let mut running = run.start();
    running.await_poses(5).signal(rustix::process::Signal::INT);
    running.finish();
    run.complete();
    let summary = run.summary();
    assert_eq!(summary["published"], 20);
    assert_eq!(summary["breaks"], 1, "nothing is known of the time between");
}

#[test]
fn what_is_no_radar_is_named_in_a_sentence() {
    let ended = |run: Run| Ended::of(run.command());
    // Nothing listens at port 9 of this machine.
    let run = Run::small().argument("--radar", "127.0.0.1:9");
    ended(run).refused_with(&["no radar answers at 127.0.0.1:9"]);
    let run = Run::small()
        .set("source.kind=colossus")
        .set("run.mode=live");
    ended(run).refused_with(&["address is missing"]);
    let run = Run::small()
        .set("source.kind=colossus")
        .set("source.address='127.0.0.1:9'");
    ended(run).refused_with(&["set run.mode to `live`"]);
}
