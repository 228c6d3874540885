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
    command.args(["simulate", "--scans", "12", "--seed", "3"]);
    command.args(["--set", "simulation.sensor.profile=cts350x-radiate"]);
    command.args(["--set", "simulation.output.format=oxford"]);
    command.args(options).arg("--out").arg(out);
    command
}

fn written(options: &[&str]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    Ended::of(simulate(folder.path(), options)).succeeded();
    folder
}

#[test]
fn streamed_and_read_from_a_disk_it_gives_the_same_motions() {
    for (format, stamps, options) in [
        ("oxford", "even", &[] as &[&str]),
        ("boreas", "even", &["--threads", "1"]),
        ("radiate", "stalling", &[]),
    ] {
        let format_key = format!("simulation.output.format={format}");
        let stamps_key = format!("simulation.output.host_stamps={stamps}");
        let settings = ["--format", format, "--set", &stamps_key];
        let recording = written(&[&settings[..], options].concat());
        let run = || streamed().set(&format_key).set(&stamps_key);
        let odometry = run().complete();
        assert_eq!(odometry::rows(&odometry).len(), SCANS - 1);
        let read = run().data(recording.path());
        assert_eq!(read.complete(), odometry, "{format}");
    }
}

#[test]
fn a_streamed_run_is_judged_leaves_no_recording_and_is_repeated_by_its_configuration() {
    let run = streamed();
    let odometry = run.complete();
    let again = Run::of_file(&run.out().join("config.toml"));
    assert_eq!(again.complete(), odometry);
    assert!(run.summary()["evaluation"]["rpe"].is_object());
    assert_eq!(run.summary()["data"], "a simulation");
    assert_eq!(run.result("ground_truth.tum").lines().count(), SCANS);
    assert!(!run.out().join("recording").exists());
}

#[test]
fn a_stored_run_keeps_its_recording_and_gives_the_same_motions() {
    let run = streamed().set("simulation.output.store=true");
    let odometry = streamed().complete();
    assert_eq!(run.complete(), odometry);
    let stored = images(&run.out().join("recording"));
    assert_eq!(stored.len(), SCANS);
    let modified = || fs::metadata(&stored[0]).unwrap().modified().unwrap();
    let written = modified();
    run.complete();
    assert_eq!(modified(), written);
    // Another drive takes its place.
    let other = run.clone().set("simulation.seed=4").option("--fresh");
    other.complete();
    assert_ne!(run.odometry(), odometry);
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
        let paths = fs::read_dir(folder).unwrap();
        let paths = paths.map(|entry| entry.unwrap().path());
        for path in paths.filter(|path| path.is_file()) {
            let content = fs::read(&path).unwrap();
            files.insert(path.file_name().unwrap().into(), content);
        }
    }
    files
}

#[test]
fn a_simulation_that_was_killed_goes_on_with_what_is_complete() {
    let folder = tempfile::tempdir().unwrap();
    let mut killed = start(folder.path());
    while !folder.path().join("radar").is_dir() || images(folder.path()).len() < 3 {
        let is_through = killed.try_wait().unwrap().is_some();
        assert!(!is_through, "it is through before it could be killed");
        thread::sleep(Duration::from_millis(1));
    }
    crate::common::send(killed.id(), Signal::KILL);
    killed.wait().unwrap();
    let kept = images(folder.path()).into_iter();
    let kept = kept
        .filter(|path| path.extension().unwrap() == "png")
        .count();
    let said = Ended::of(simulate(folder.path(), &[])).stdout;
    let sentence = format!("{kept} were there already");
    assert!(said.contains(&sentence), "{said}");
    assert!(all_files(folder.path()) == all_files(written(&["--threads", "5"]).path()));
}

fn start(out: &Path) -> Child {
    let mut command = simulate(out, &[]);
    command.stdout(Stdio::null()).stderr(Stdio::null());
    command.spawn().unwrap()
}

#[test]
fn a_folder_of_another_recording_is_refused() {
    let recording = written(&[]);
    let faster = ["--set", "simulation.drive.speed_mps=5"];
    Ended::of(simulate(recording.path(), &faster))
        .refused_with(&["dataset of another configuration", "another folder"]);
    let unknown = Ended::of(simulate(recording.path(), &["--format", "fomo"])).stderr;
    assert!(
        unknown.contains("`oxford`, `boreas`, `radiate`"),
        "{unknown}"
    );
}
