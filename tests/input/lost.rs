//! Input that cannot be reached for a while, and recordings with many damaged scans: nothing is
//! lost silently.

use std::{fs, path::Path, thread, time::Duration};

use crate::common::{
    Run,
    recording::{self, MIDDLE, MODERATE},
    send, undisturbed,
};
use rustix::process::Signal;
use tempfile::TempDir;

/// A whole recording, and a run of it at a rate.
fn whole(rate: &str) -> (TempDir, Run) {
    let recording = recording::copy(recording::SCANS);
    let run = Run::small().data(recording.path());
    (recording, run.rate(rate))
}

/// Moves the folder of images away.
fn take_away(recording: &Path) {
    fs::rename(recording.join("radar"), recording.join("away")).unwrap();
}

fn bring_back(recording: &Path) {
    fs::rename(recording.join("away"), recording.join("radar")).unwrap();
}

/// Asserts that every scan was played and is in the result.
fn assert_whole(run: &Run) {
    assert_eq!(run.odometry(), undisturbed());
    run.assert_counts("published=24 unreadable=0");
}

#[test]
fn a_folder_that_is_away_for_a_moment_loses_nothing_whatever_restarts_meanwhile() {
    for killed in [
        &[][..],
        &["radar-replay"],
        &["masking", "rotation-search", "pose-integration"],
    ] {
        let (recording, run) = whole(MODERATE);
        let mut running = run.start();
        let stages = running.await_stages();
        running.await_poses(MIDDLE);
        take_away(recording.path());
        thread::sleep(Duration::from_millis(300));
        for stage in killed {
            send(stages[*stage], Signal::KILL);
        }
        thread::sleep(Duration::from_millis(300));
        bring_back(recording.path());
        running.finish().succeeded();
        assert_whole(&run);
    }
}

#[test]
fn a_source_that_waits_for_its_input_has_not_stalled() {
    let (recording, run) = whole(MODERATE);
    let run = run.set("run.stall_timeout_s=2");
    let running = run.started(MIDDLE);
    take_away(recording.path());
    thread::sleep(Duration::from_secs(4));
    bring_back(recording.path());
    running.finish().succeeded().does_not_say("restarted");
    assert_whole(&run);
}

#[test]
fn a_folder_that_stays_away_ends_the_run_and_the_same_command_goes_on() {
    let (recording, run) = whole(MODERATE);
    let run = run.set("source.retry_s=0.3");
    let running = run.started(MIDDLE);
    take_away(recording.path());
    running.finish().failed_with(&[
        "radar-replay: cannot read",
        ".png: No such file or directory",
        "tried again for 0.3 s (source.retry_s)",
        "poses are kept",
        "the same command resumes",
    ]);
    bring_back(recording.path());
    run.complete();
    assert_whole(&run);
    assert!(run.count("resumed_after") >= MIDDLE as u64);
}

#[test]
fn a_run_that_waits_for_its_input_can_be_interrupted() {
    let (recording, run) = whole(MODERATE);
    // A time longer than any run is no limit.
    let run = run.sets("source.retry_s=1e300 run.stall_timeout_s=1e300");
    let running = run.started(MIDDLE);
    take_away(recording.path());
    thread::sleep(Duration::from_millis(300));
    running.interrupt();
    bring_back(recording.path());
    run.complete();
    assert_whole(&run);
}

#[test]
fn a_live_run_whose_folder_is_away_for_a_moment_accounts_for_every_scan() {
    let (recording, run) = whole("4");
    let run = run.set("run.mode=live");
    let running = run.started(MIDDLE);
    take_away(recording.path());
    thread::sleep(Duration::from_millis(600));
    bring_back(recording.path());
    running.finish().succeeded();
    run.assert_counts("published=24 unreadable=0");
    // A sensor does not wait for the disk.
    let [processed, dropped] = ["processed", "dropped"].map(|key| run.count(key));
    assert!(
        processed + dropped == 24 && dropped > 0,
        "{processed} {dropped}"
    );
}

#[test]
fn a_source_restarted_after_files_came_and_went_plays_the_same_scans() {
    let (recording, run) = whole(MODERATE);
    let mut running = run.started(MIDDLE);
    let images = recording::images(recording.path());
    fs::copy(&images[0], recording.path().join("radar/1.png")).unwrap();
    for image in &images[1..4] {
        fs::remove_file(image).unwrap();
    }
    running.kill("radar-replay");
    running.finish().succeeded();
    assert_whole(&run);
}

// Damaged scans.

/// A recording with damaged scans, and a run of it.
fn damaged(scans: impl IntoIterator<Item = usize>) -> (TempDir, Run) {
    let recording = recording::copy(recording::SCANS);
    let images = recording::images(recording.path());
    for scan in scans {
        recording::truncate(&images[scan], 100_000);
    }
    let run = Run::small().data(recording.path());
    (recording, run)
}

#[test]
fn many_damaged_scans_in_a_row_end_the_run_and_a_higher_limit_continues_it() {
    let (_recording, run) = damaged(8..11);
    let few = run.clone().set("source.max_unreadable=2");
    few.finish().failed_with(&[
        "3 scans in a row cannot be read",
        "is truncated",
        "source.max_unreadable is 2",
        "the same command resumes",
    ]);
    run.complete();
    run.assert_counts("unreadable=3");
    assert!(run.count("resumed_after") > 0);
}

#[test]
fn a_recording_with_many_damaged_scans_gives_results_but_no_success() {
    let (_recording, run) = damaged((1..recording::SCANS).step_by(3));
    let ended = run.finish();
    ended.failed_with(&["8 of the 24 scans", "cannot be read", "log.jsonl"]);
    ended.prints("complete but for unreadable scans");
    assert_eq!(run.summary()["processed"], 16);
}

#[test]
fn scans_are_numbered_as_in_the_recording() {
    let (_recording, run) = damaged([9]);
    let run = run.set("source.first=7");
    run.complete();
    let rows = crate::common::odometry::rows(&run.odometry());
    assert_eq!((rows[0].scan, rows[0].previous_scan), (8, 7));
    assert_eq!((rows[1].scan, rows[1].previous_scan), (10, 8));
    run.assert_counts("published=16 unreadable=1");
}
