//! `gyre run` as a whole: six processes, the same result every time, whatever interrupts it.

use std::process::Command;

use crate::common::{
    Run, STAGES, odometry,
    recording::{self, MIDDLE, MODERATE},
    undisturbed,
};
use rustix::process::Signal;

#[test]
fn all_results_are_there_and_account_for_every_scan() {
    let run = Run::of_recording();
    let rows = odometry::rows(&run.complete());
    assert_eq!(rows.len(), recording::SCANS - 1);
    assert_eq!((rows[0].scan, rows[0].previous_scan), (1, 0));
    odometry::assert_unbroken(&rows);
    for (file, part) in [
        ("trajectory.tum", "154713240"),
        ("trajectory.svg", "<svg"),
        ("errors.svg", "<svg"),
        ("bands.svg", "<svg"),
        ("latency.json", "sensor_to_pose"),
        ("config.toml", "[masking]"),
        ("log.jsonl", ""),
    ] {
        assert!(run.result(file).contains(part), "{file}");
    }
    assert_eq!(
        run.result("trajectory.tum")
            .lines()
            .filter(|line| !line.starts_with('#'))
            .count(),
        recording::SCANS
    );
    for state in ["poses.journal", "refinement.map"] {
        assert!(run.out().join("journal").join(state).is_file(), "{state}");
    }
    run.assert_counts("published=24 processed=24 scans_in_recording=24");
    run.assert_counts("dropped=0 unreadable=0 breaks=0 resumed_after=0");
    let summary = run.summary();
    assert_eq!(summary["ending"], "complete");
    assert_eq!(summary["restarts"].as_object().unwrap().len(), 0);
    for stage in STAGES {
        let log = run.result(format!("log/{stage}.txt"));
        assert_eq!(log, "", "{stage} complains");
        let processed = &summary["stages"][stage]["processed"];
        assert_eq!(*processed, recording::SCANS, "{stage}");
    }
}

#[test]
fn the_resolved_configuration_plays_the_data_that_were_named_instead_of_a_simulation() {
    let run = Run::simulated(3).data(recording::small());
    assert_eq!(run.complete(), undisturbed());
    assert_eq!(
        Run::of_file(&run.out().join("config.toml")).complete(),
        undisturbed()
    );
}

#[test]
fn an_interrupted_run_names_how_it_is_resumed_and_resumes_at_another_rate_and_window() {
    let run = Run::of_recording();
    let slow = run.clone().rate(MODERATE);
    let mut running = slow.start();
    running.await_poses(MIDDLE).signal(Signal::INT);
    let ended = running.finish();
    assert_eq!(ended.code(), Some(130), "{}", ended.stderr);
    ended.prints("the same command resumes");
    let processed = run.count("processed");
    let partial = MIDDLE as u64..recording::SCANS as u64;
    assert!(partial.contains(&processed), "{processed}");
    let run = run.set("run.window=2");
    assert_eq!(run.complete(), undisturbed());
    assert!(run.count("resumed_after") >= processed);
}

#[test]
fn a_reader_that_has_seen_enough_does_not_stop_the_run() {
    let run = Run::of_recording();
    let mut shell = Command::new("sh");
    let own = run.command();
    // Both outputs are pipes that nobody reads.
    shell
        .args(["-c", "\"$@\" 2>&1 | true", "sh"])
        .arg(own.get_program())
        .args(own.get_args());
    run.start_as(shell).finish().succeeded();
    assert_eq!(run.odometry(), undisturbed());
}

#[test]
fn data_in_a_folder_with_any_name_are_played() {
    let run = Run::of_recording();
    for name in ["2019-01-10", "1e5", "true", "it's a \"drive\""] {
        let link = run.folder().join(name);
        std::os::unix::fs::symlink(recording::small(), &link).unwrap();
        let named = Run::small().option(name);
        let mut command = named.command();
        command.current_dir(run.folder());
        named.start_as(command).finish().succeeded();
        assert_eq!(named.odometry(), undisturbed(), "{name}");
    }
}
