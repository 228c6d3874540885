//! Times that are wrong, and recordings with gaps: a run waits for no year, and says where the
//! chain of motions breaks.

use std::{
    fs,
    ops::Range,
    path::{Path, PathBuf},
};

use crate::{
    common::{Run, STAGES, odometry, recording, runtime_is_installed, send},
    method::in_process::assert_same_bits,
};
use rustix::process::Signal;
use tempfile::TempDir;

/// The recording's six seconds in one.
const MODERATE: &str = "6";
/// The scan before which time breaks.
const BREAK: usize = 12;
const HOUR_US: i64 = 3_600_000_000;
const YEAR_US: i64 = 8_760 * HOUR_US;

pub fn run_of(recording: &TempDir) -> Run {
    Run::of_recording_named(recording.path().to_str().unwrap())
}

/// Damages the times of scan 9, and asserts that it alone is left out, in real time too.
fn skips(reason: &str, damage: impl FnOnce(&Path)) {
    let recording = recording::copy(16);
    damage(&recording::images(recording.path())[9]);
    let run = run_of(&recording).rate(MODERATE);
    run.complete();
    let summary = run.summary();
    assert_eq!(
        (
            &summary["published"],
            &summary["unreadable"],
            &summary["breaks"]
        ),
        (&15.into(), &1.into(), &0.into())
    );
    odometry::assert_unbroken(&odometry::rows(&run.odometry()));
    assert!(run.result("log.jsonl").contains(reason));
}

#[test]
fn a_row_that_is_a_year_ahead_makes_its_scan_unreadable() {
    skips("row 200: stamp is 31536000", |image| {
        recording::restamp(image, |row, us| us + if row == 200 { YEAR_US } else { 0 });
    });
}

#[test]
fn a_row_that_is_a_year_behind_makes_its_scan_unreadable() {
    skips("s before that of an earlier row", |image| {
        recording::restamp(image, |row, us| us - if row == 200 { YEAR_US } else { 0 });
    });
}

#[test]
fn a_scan_whose_rows_are_a_year_from_its_name_is_unreadable() {
    for by_us in [YEAR_US, -YEAR_US] {
        skips("from the time in its name", |image| {
            recording::restamp(image, |_, us| us + by_us);
        });
    }
}

/// A recording with a gap of a year before scan [`BREAK`].
pub fn with_a_gap() -> TempDir {
    let recording = recording::copy(recording::SCANS);
    for image in &recording::images(recording.path())[BREAK..] {
        recording::shift(image, YEAR_US);
    }
    recording
}

/// A recording whose clock was set back by an hour before scan [`BREAK`]; its files are numbered.
fn with_a_clock_set_back() -> TempDir {
    let recording = recording::copy(recording::SCANS);
    let images = recording::images(recording.path());
    for image in &images[BREAK..] {
        recording::restamp(image, |_, us| us - HOUR_US);
    }
    for (number, image) in images.iter().enumerate() {
        fs::rename(image, image.with_file_name(format!("{number:06}.png"))).unwrap();
    }
    recording
}

/// Asserts that the chain of motions breaks before scan [`BREAK`] and nowhere else.
fn assert_breaks_once(run: &Run) {
    let summary = run.summary();
    for (key, value) in [
        ("published", recording::SCANS),
        ("processed", recording::SCANS),
        ("unreadable", 0),
        ("missing", 0),
        ("breaks", 1),
    ] {
        assert_eq!(summary[key], value, "{key}");
    }
    let rows = odometry::rows(&run.odometry());
    let scans: Vec<u64> = rows.iter().map(|row| row.scan).collect();
    let expected = (1..recording::SCANS as u64).filter(|scan| *scan != BREAK as u64);
    assert_eq!(scans, expected.collect::<Vec<_>>());
}

#[test]
fn a_gap_of_a_year_breaks_the_chain_and_nobody_waits_for_it() {
    let recording = with_a_gap();
    let fast = run_of(&recording);
    fast.complete();
    assert_breaks_once(&fast);
    let paced = run_of(&recording).rate(MODERATE);
    assert_eq!(paced.complete(), fast.odometry());
}

#[test]
fn a_clock_that_was_set_back_breaks_the_chain() {
    let recording = with_a_clock_set_back();
    let fast = run_of(&recording);
    fast.complete();
    assert_breaks_once(&fast);
    let paced = run_of(&recording).rate(MODERATE);
    assert_eq!(paced.complete(), fast.odometry());
}

#[test]
fn a_live_run_over_a_gap_or_a_clock_that_was_set_does_not_take_the_rest_for_missed() {
    for recording in [with_a_gap(), with_a_clock_set_back()] {
        let run = run_of(&recording).rate("2").set("run.mode=live");
        run.complete();
        let summary = run.summary();
        assert_eq!(
            (&summary["published"], &summary["breaks"]),
            (&recording::SCANS.into(), &1.into())
        );
        let processed = summary["processed"].as_u64().unwrap();
        assert!(
            processed > (recording::SCANS - BREAK / 2) as u64,
            "{summary}"
        );
    }
}

#[test]
fn a_restart_at_a_break_gives_the_same_bytes() {
    assert_same_after_kills(BREAK..BREAK + 1, &["refinement"]);
}

#[test]
#[ignore = "nightly: kills at many moments"]
fn a_restart_of_any_stage_about_a_break_gives_the_same_bytes() {
    assert_same_after_kills(BREAK + 1..BREAK + 3, &STAGES);
}

/// Kills all stages after each number of poses, and each of these alone at the break.
fn assert_same_after_kills(moments: Range<usize>, alone: &[&str]) {
    let recording = with_a_gap();
    let undisturbed = run_of(&recording).complete();
    for poses in moments {
        let run = run_of(&recording).rate(MODERATE);
        let mut running = run.start();
        let stages = running.await_stages();
        running.await_poses(poses);
        stages.values().for_each(|pid| send(*pid, Signal::KILL));
        running.finish().succeeded();
        assert_eq!(run.odometry(), undisturbed, "after {poses} poses");
    }
    for stage in alone {
        let run = run_of(&recording).rate(MODERATE);
        let mut running = run.start();
        running.await_poses(BREAK).kill(stage);
        running.finish().succeeded();
        assert_eq!(run.odometry(), undisturbed, "{stage}");
    }
}

#[test]
#[ignore = "nightly: kills at many moments"]
fn a_restart_at_a_break_gives_the_same_bytes_with_a_network_that_looks_at_two_scans() {
    if !runtime_is_installed() {
        return;
    }
    let (recording, card) = (with_a_gap(), pair_network());
    let undisturbed = run_of(&recording).masked_by(&card).complete();
    for poses in BREAK..BREAK + 4 {
        let run = run_of(&recording).masked_by(&card).rate(MODERATE);
        let mut running = run.start();
        let stages = running.await_stages();
        running.await_poses(poses);
        stages.values().for_each(|pid| send(*pid, Signal::KILL));
        running.finish().succeeded();
        assert_eq!(run.odometry(), undisturbed, "after {poses} poses");
    }
}

#[test]
fn the_method_in_one_process_breaks_the_chain_at_the_same_scan() {
    for recording in [with_a_gap(), with_a_clock_set_back()] {
        assert_same_bits(&run_of(&recording));
        if runtime_is_installed() {
            assert_same_bits(&run_of(&recording).masked_by(&pair_network()));
        }
    }
}

fn pair_network() -> PathBuf {
    Path::new(crate::PROJECT).join("shared/method/masking/tests/models/pair-127.toml")
}
