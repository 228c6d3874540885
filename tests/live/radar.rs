//! A radar on the network: `gyre radar-server` plays a recording as one, and a run receives it
//! live.

use std::{
    net::{TcpListener, UdpSocket},
    path::Path,
    process,
    sync::mpsc::{self, RecvTimeoutError},
    thread,
    time::Duration,
};

use rustix::process::Signal;
use tempfile::TempDir;

use crate::{
    common::{Ended, Run, Spawned, Watch, gyre, odometry, recording},
    operate::commands::ask,
};

/// Faster than the radar turns, and slow enough for a run to keep up.
const RATE: &str = "1.5";

/// A radar on a port of its own, which is switched off when it is dropped.
pub(crate) struct Radar {
    server: Spawned,
    pub address: String,
    _folder: TempDir,
}

impl Radar {
    pub fn playing(recording: &Path, arguments: &[&str]) -> Self {
        Self::to(&["--listen", "127.0.0.1:0"], recording, arguments)
    }

    /// One that sends to a group by UDP, and describes only itself for as long as a run takes to
    /// begin.
    pub fn sending(group: &str, recording: &Path, arguments: &[&str]) -> Self {
        Self::to(&["--udp", group, "--wait-s", "4"], recording, arguments)
    }

    pub fn to(whom: &[&str], recording: &Path, arguments: &[&str]) -> Self {
        let mut command = gyre();
        command.arg("radar-server").args(whom);
        if !arguments.contains(&"--rate") {
            command.args(["--rate", RATE]);
        }
        command.arg(recording).args(arguments);
        let folder = TempDir::new().unwrap();
        let server = Spawned::new(command, folder.path().join("said"));
        let address = server.until(|said| {
            let (line, _) = said.split_once('\n')?;
            line.rsplit(' ').next().map(str::to_owned)
        });
        Self {
            server,
            address,
            _folder: folder,
        }
    }

    pub fn run(&self, scans: usize) -> Run {
        run_at(&self.address).set(&format!("source.scans={scans}"))
    }

    /// Waits until the radar has played all, and returns its report of played and lost azimuths.
    pub fn played(&mut self) -> Played {
        self.server.wait();
        let said = self.server.said();
        let report = said.lines().last().unwrap();
        let numbers = report.split(|c: char| !c.is_ascii_digit());
        let mut numbers = numbers.filter_map(|number| number.parse().ok());
        let mut next = || numbers.next().unwrap_or_else(|| panic!("{said}"));
        Played {
            scans: next(),
            lost_azimuths: next(),
            resets: {
                let _lost_datagrams: u64 = next();
                next()
            },
        }
    }

    pub fn received(&self, scans: usize) -> Run {
        self.run(scans).set("source.interface='127.0.0.1'")
    }
}

#[derive(Debug)]
pub(crate) struct Played {
    pub scans: u64,
    pub lost_azimuths: u64,
    pub resets: u64,
}

/// A run without end of a radar at an address, with the constants that the recording has in its
/// `dataset.toml`.
pub(crate) fn run_at(address: &str) -> Run {
    recording::with_constants(Run::small().option(address)).set("source.silence_s=1")
}

/// A copy of so many scans of the small recording. All its rows are measured, because a radar sends
/// no others.
pub(crate) fn whole(scans: usize) -> TempDir {
    complete(recording::copy(scans))
}

/// Makes all rows of a recording measured ones.
pub(crate) fn complete(drive: TempDir) -> TempDir {
    let images = recording::images(drive.path());
    images.iter().for_each(|image| recording::complete(image));
    drive
}

#[test]
fn a_radar_gives_the_motions_of_its_recording() {
    let scans = recording::SCANS / 2;
    let whole = whole(scans);
    let recorded = Run::small().data(whole.path()).complete();
    for clock in [&[][..], &["--big-endian"]] {
        let radar = Radar::playing(whole.path(), clock);
        let run = radar.run(scans);
        let live = run.complete();
        run.assert_counts("dropped=0 stages/radar-replay/missing_azimuths=0");
        assert!(live == recorded, "{clock:?}:\n{live}\n{recorded}");
    }
}

#[test]
fn what_a_radar_delivers_is_a_topic() {
    let whole = whole(recording::SCANS);
    let radar = Radar::playing(whole.path(), &[]);
    let run = radar.run(recording::SCANS);
    let running = run.started(2);
    let watched = Watch::start(&run, "intake").await_message();
    running.complete();
    let watched = watched.finish();
    assert!(watched.seqs.is_sorted() && watched.gaps == 0, "{watched:?}");
    assert_eq!(watched.seqs.last(), Some(&(recording::SCANS as u64 - 1)));
}

/// A group that only this test of this process sends to.
pub(crate) fn group(test: u8) -> String {
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
    let whole = whole(recording::SCANS);
    let scans = recording::SCANS / 2;
    let radar = Radar::sending(&group(1), whole.path(), &["--repeat"]);
    let run = radar.received(scans);
    let live = run.complete();
    run.assert_counts("dropped=0 stages/radar-replay/missing_azimuths=0");
    run.assert_counts("stages/radar-replay/damaged_messages=0");
    // On a busy machine the radar may have begun before the run.
    let all = Run::small().data(whole.path()).complete();
    let stamps = |csv| odometry::columns(csv, &["stamp_ns", "previous_scan"]);
    let begun = &stamps(&live)[0][0];
    let all = stamps(&all);
    let first = &all.iter().find(|row| row[0] == *begun).unwrap()[1];
    let recorded = Run::small().data(whole.path());
    let recorded = recorded.sets(&format!("source.first={first} source.scans={scans}"));
    assert_eq!(motions(&live), motions(&recorded.complete()));
}

#[test]
fn datagrams_without_scans_are_named_in_a_sentence() {
    let to = group(3);
    let run = Run::small().option(&format!("udp://{to}"));
    let run = run.set("source.interface='127.0.0.1'");
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
}

#[test]
fn an_interrupted_run_goes_on_with_the_same_command() {
    let radar = Radar::playing(recording::small(), &["--repeat"]);
    let run = radar.run(20);
    let mut running = run.start();
    running.await_poses(5).signal(Signal::INT);
    running.finish();
    run.complete();
    // Nothing is known of the time between.
    run.assert_counts("published=20 breaks=1");
}

#[test]
fn a_radar_that_is_not_there_yet_is_waited_for_and_a_signal_ends_the_wait() {
    let free = TcpListener::bind("127.0.0.1:0").unwrap().local_addr();
    let free = free.unwrap().to_string();
    let run = run_at(&free).set("source.scans=8");
    let waits = format!("waits for its radar: no radar answers at {free}");
    let mut running = run.start();
    running.await_words(&waits);
    ask(&run, &["ps", "--check"]).refused_with(&[&waits]);
    let once = ask(&run, &["top", "--once"]);
    let once = &once.succeeded().stdout;
    assert!(
        once.starts_with("waiting for radar, up for ") && once.contains(&waits),
        "{once}"
    );
    running.interrupt();
    let mut running = run.start();
    running.await_words(&waits);
    let _radar = Radar::to(&["--listen", &free], recording::small(), &[]);
    running.finish().succeeded();
    assert_eq!(run.summary()["published"], 8);
}
