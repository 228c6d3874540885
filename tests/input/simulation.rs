//! Simulated drives with real processes: played by `gyre run` without touching the disk.

use crate::common::{Run, finished, odometry};

const SCANS: usize = 12;
const CONFIGURATION: &str = "[raster]\nn = 127\ncell_m = 0.8\n[simulation]\nscans = 12\nseed = 3
    sensor.profile = 'cts350x-radiate'\noutput.format = 'oxford'\n";

fn streamed() -> Run {
    Run::configured(CONFIGURATION)
}

#[test]
fn a_streamed_run_is_judged_and_is_repeated_by_its_configuration() {
    let run = streamed();
    let odometry = run.complete();
    let again = Run::of_file(&run.out().join("config.toml"));
    assert_eq!(again.complete(), odometry);
    assert!(run.summary()["evaluation"]["rpe"].is_object());
    assert_eq!(run.summary()["data"], "a simulation");
    assert_eq!(run.result("ground_truth.tum").lines().count(), SCANS);
}

#[test]
fn a_part_of_a_simulation_is_the_same_part_of_its_recording() {
    let recording = tempfile::tempdir().unwrap();
    let words = "simulate --scans 12 --seed 3 \
        --set simulation.sensor.profile=cts350x-radiate \
        --set simulation.output.format=oxford --out";
    finished![; words.split_whitespace(); [recording.path()]].succeeded();
    let part = |run: Run| run.set("source.first=4").set("source.scans=5").complete();
    assert_eq!(part(streamed()), part(streamed().data(recording.path())));
}

#[test]
fn a_radar_that_does_not_wait_can_be_simulated() {
    let run = streamed().rate("0.5").set("run.mode=live");
    let rows = odometry::rows(&run.complete());
    odometry::assert_unbroken(&rows);
    let [processed, dropped] = ["processed", "dropped"].map(|key| run.count(key));
    assert_eq!(processed + dropped, SCANS as u64);
    assert_eq!(run.count("published"), SCANS as u64);
}
