//! A live radar with a live GNSS receiver, whose fixes arrive in datagrams.

use tempfile::TempDir;

use super::{
    gyro::{address, lines_of, sending},
    radar::{Radar, complete},
};
use crate::{
    common::{
        Run,
        recording::{self, around_a_block},
    },
    observers::record::{self, recorded},
    slam::gnss::{left, log, with_antenna},
};

/// Scans of the drive, and the fixes of that time: before the reflection.
pub const SCANS: usize = 48;
pub const FIXES: usize = 58;

/// The beginning of the drive around a block. All its rows are measured, because a radar sends no
/// others.
pub fn drive() -> TempDir {
    complete(recording::linked(around_a_block(), |scan| scan < SCANS))
}

/// A run of a live radar and a receiver that sends to this address.
fn receiving(radar: &Radar, address: &str, scans: usize) -> Run {
    let run = with_graph(radar.run(scans)).set("gnss.kind=udp");
    run.set(&format!("gnss.listen='{address}'"))
}

/// A run whose trajectory is corrected by fixes.
pub fn with_graph(run: Run) -> Run {
    with_antenna(run.sets("slam.kind=graph run.window=32"))
}

/// The messages that the receiver sends during the drive.
pub fn log_of_drive() -> String {
    let text = log();
    let lines = text.lines().take(1 + FIXES);
    lines.map(|line| format!("{line}\n")).collect()
}

/// Returns the lines of a receiver during the drive: one line comes late, one twice, one is no
/// line of a receiver, and one has no fix.
fn lines() -> Vec<String> {
    let mut lines = lines_of(&log_of_drive());
    lines.swap(20, 21);
    lines.insert(30, lines[29].clone());
    let stamp = lines[50].split(',').next().unwrap();
    lines.insert(50, format!("{stamp},,"));
    lines
}

#[test]
fn fixes_of_a_live_receiver_correct_the_trajectory_and_the_recording_replays_to_it() {
    let drive = drive();
    let address = address(3);
    let radar = Radar::playing(drive.path(), &[]);
    let run = recorded(&receiving(&radar, &address, SCANS));
    let receiver = sending(lines(), address, 700);
    // Who reads the fixes is killed while they arrive.
    let mut running = run.started(SCANS / 3);
    running.kill("trajectory");
    let live = running.complete();
    receiver.join().unwrap();
    assert_eq!(run.summary()["dropped"], 0);
    assert_eq!(run.summary()["restarts"]["trajectory"], 1);
    let without = Run::small().data(drive.path()).set("slam.kind=graph");
    assert_eq!(live, without.complete());
    let corrected = |run: &Run| run.result("trajectory_slam.tum");
    assert_ne!(corrected(&run), corrected(&without));
    let gnss = run.summary()["gnss"].clone();
    let faults = [
        "unreadable",
        "without_fix",
        "repeated",
        "out_of_order",
        "zero",
    ];
    for fault in faults {
        assert_eq!(gnss["faults"][fault], 1, "{fault}: {gnss}");
    }
    assert_eq!(gnss["faults"]["lost"], 0, "{gnss}");
    assert!(gnss["used"].as_u64().unwrap() > 20, "{gnss}");
    assert_replays(&run);
}

/// The recording of a run, and the fixes beside it, lead to the same results.
pub fn assert_replays(run: &Run) {
    assert_eq!(left(&replayed(run)), left(run));
}

fn replayed(run: &Run) -> Run {
    record::replayed(&record::file(run), &[]).0
}

#[test]
fn a_live_receiver_that_is_silent_leaves_slam_to_the_radar_and_that_is_said() {
    let radar = Radar::playing(recording::small(), &[]);
    let run = recorded(&receiving(&radar, &address(4), 12));
    let expected = "the fixes of GNSS are not used: the log of the GNSS receiver";
    run.finish().failed_with(&[expected]);
    assert_eq!(run.summary()["gnss"]["used"], 0);
    let trajectory = |run: &Run| run.result("trajectory_slam.tum");
    assert!(trajectory(&run).lines().count() >= 11);
    assert_eq!(trajectory(&replayed(&run)), trajectory(&run));
}
