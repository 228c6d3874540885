//! Simulated drives with real processes: written by `gyre simulate`, and played by `gyre run`
//! without touching the disk.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    thread,
    time::Duration,
};

use crate::common::{Ended, Run, gyre, odometry};
use rustix::process::Signal;

const SCANS: usize = 12;
const CONFIGURATION: &str = "[raster]\nn = 127\ncell_m = 0.8\n[simulation]\nscans = 12\nseed = 3
    sensor.profile = 'cts350x-radiate'\noutput.format = 'oxford'\n";

fn streamed() -> Run {
    Run::configured(CONFIGURATION)
}

fn simulate(out: &Path, options: &[&str]) -> Command {
    let mut command = gyre();
    command
        .args(["simulate", "--scans", "12", "--seed", "3"])
        .args(["--set", "simulation.sensor.profile=cts350x-radiate"])
        .args(["--set", "simulation.output.format=oxford"])
        .args(options)
        .arg("--out")
        .arg(out);
    command
}

fn written(options: &[&str]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    Ended::of(simulate(folder.path(), options)).succeeded();
    folder
}

#[test]
fn streamed_and_read_from_a_disk_it_gives_the_same_motions() {
    for options in [
        &["--format", "oxford"][..],
        &["--format", "boreas", "--threads", "1"],
        &[
            "--format",
            "radiate",
            "--set",
            "simulation.output.host_stamps=stalling",
        ],
    ] {
        let recording = written(options);
        let set = |run: Run| {
            let run = run.set(&format!("simulation.output.format={}", options[1]));
            let stamps = if options[1] == "radiate" {
                "stalling"
            } else {
                "even"
            };
            run.set(&format!("simulation.output.host_stamps={stamps}"))
        };
        let odometry = set(streamed()).complete();
        assert_eq!(odometry::rows(&odometry).len(), SCANS - 1);
        assert_eq!(
            set(streamed()).data(recording.path()).complete(),
            odometry,
            "{options:?}"
        );
    }
}

#[test]
fn a_streamed_run_is_judged_and_leaves_no_recording() {
    let run = streamed();
    run.complete();
    assert!(run.summary()["evaluation"]["rpe"].is_object());
    assert_eq!(run.summary()["data"], "a simulation");
    assert_eq!(run.result("ground_truth.tum").lines().count(), SCANS);
    assert!(!run.out().join("recording").exists());
}

#[test]
fn a_stored_run_keeps_its_recording_and_gives_the_same_motions() {
    let run = streamed().set("simulation.output.store=true");
    assert_eq!(run.complete(), streamed().complete());
    assert_eq!(images(&run.out().join("recording")).len(), SCANS);
    let written = fs::metadata(&images(&run.out().join("recording"))[0])
        .unwrap()
        .modified()
        .unwrap();
    run.complete();
    assert_eq!(
        fs::metadata(&images(&run.out().join("recording"))[0])
            .unwrap()
            .modified()
            .unwrap(),
        written
    );
    // Another drive takes its place.
    run.clone()
        .set("simulation.seed=4")
        .option("--fresh")
        .complete();
    assert_ne!(run.odometry(), streamed().complete());
}

#[test]
fn the_resolved_configuration_of_a_streamed_run_repeats_it() {
    let run = streamed();
    let odometry = run.complete();
    assert_eq!(
        Run::of_file(&run.out().join("config.toml")).complete(),
        odometry
    );
}

#[test]
fn a_part_of_a_simulation_is_the_same_part_of_its_recording() {
    let part = |run: Run| run.set("source.first=4").set("source.scans=5").complete();
    assert_eq!(part(streamed()), part(streamed().data(written(&[]).path())));
}

#[test]
fn a_radar_that_does_not_wait_can_be_simulated() {
    let run = streamed().rate("0.5").set("run.mode=live");
    let rows = odometry::rows(&run.complete());
    odometry::assert_unbroken(&rows);
    let summary = run.summary();
    let count = |key: &str| summary[key].as_u64().unwrap();
    assert_eq!(count("published"), SCANS as u64);
    assert_eq!(count("processed") + count("dropped"), count("published"));
}

fn images(recording: &Path) -> Vec<PathBuf> {
    crate::common::recording::images(recording)
}

fn all_files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut files = BTreeMap::new();
    for folder in [folder.to_owned(), folder.join("radar"), folder.join("gt")] {
        let entries = fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .filter(|path| path.is_file());
        files.extend(
            entries.map(|path| (path.file_name().unwrap().into(), fs::read(path).unwrap())),
        );
    }
    files
}

#[test]
fn a_simulation_that_was_killed_goes_on_with_what_is_complete() {
    let folder = tempfile::tempdir().unwrap();
    let mut killed = start(folder.path());
    while !folder.path().join("radar").is_dir() || images(folder.path()).len() < 3 {
        assert!(
            killed.try_wait().unwrap().is_none(),
            "it is through before it could be killed"
        );
        thread::sleep(Duration::from_millis(1));
    }
    crate::common::send(killed.id(), Signal::KILL);
    killed.wait().unwrap();
    let kept = images(folder.path())
        .into_iter()
        .filter(|path| path.extension().unwrap() == "png")
        .count();
    let ended = Ended::of(simulate(folder.path(), &[]));
    assert!(
        ended.stdout.contains(&format!("{kept} were there already")),
        "{}",
        ended.stdout
    );
    assert!(all_files(folder.path()) == all_files(written(&["--threads", "5"]).path()));
}

fn start(out: &Path) -> Child {
    let mut command = simulate(out, &[]);
    command
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

#[test]
fn a_folder_of_another_recording_is_refused() {
    let recording = written(&[]);
    let refused = Ended::of(simulate(
        recording.path(),
        &["--set", "simulation.drive.speed_mps=5"],
    ));
    refused.refused_with(&["dataset of another configuration", "another folder"]);
    let unknown = Ended::of(simulate(recording.path(), &["--format", "fomo"]));
    assert!(
        unknown.stderr.contains("oxford, boreas, radiate"),
        "{}",
        unknown.stderr
    );
}
