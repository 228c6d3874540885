//! Runs with a gyro: its samples travel with the scans, so that no kill, rate or replay changes a
//! byte.

use std::path::PathBuf;

use gyre_simulator::{GyroProfile, OutputFormat, Profile, SimulationConfig};

use crate::{
    common::{Run, STAGES, recording},
    observers::record::{file, recorded, replay},
};

/// Time by which the log is late, s.
const LATE_S: f64 = 0.75;

/// A recording as RADIATE has them, with the log of a gyro whose clock is late and whose host
/// stalls and loses samples.
fn with_log() -> PathBuf {
    let mut config = SimulationConfig {
        scans: Some(recording::SCANS),
        ..SimulationConfig::default()
    };
    config.sensor.profile = Profile::Cts350xRadiate;
    config.output.format = Some(OutputFormat::Radiate);
    config.drive.speed_mps = 5.0;
    config.effects.lost_azimuths = Some(true);
    config.gyro.profile = GyroProfile::Asm330lhh;
    config.gyro.late_s = LATE_S;
    config.gyro.stall_every_s = 2.0;
    config.gyro.stall_s = 0.06;
    config.gyro.lost = 0.02;
    recording::of("gyro", &config)
}

fn radar_alone() -> Run {
    Run::small().data(&with_log())
}

fn with_gyro() -> Run {
    let run = radar_alone().set("gyro.kind=auto");
    run.set(&format!("gyro.late_s={LATE_S}"))
}

/// The undisturbed result.
fn undisturbed() -> String {
    let run = with_gyro();
    run.complete();
    let gyro = &run.summary()["gyro"];
    assert!(gyro["motions"].as_u64() > Some(15), "{gyro}");
    run.odometry()
}

#[test]
fn whatever_is_killed_the_result_is_the_undisturbed_one() {
    let undisturbed = undisturbed();
    let alone = radar_alone();
    alone.complete();
    assert_ne!(alone.odometry(), undisturbed);
    for stage in STAGES {
        let run = with_gyro().rate("6");
        let mut running = run.start();
        running.await_poses(recording::SCANS / 3).kill(stage);
        running.finish().succeeded();
        assert_eq!(run.odometry(), undisturbed, "{stage}");
    }
}

#[test]
fn a_run_that_is_continued_has_the_same_result() {
    let run = with_gyro().rate("6");
    let mut running = run.start();
    running.await_poses(recording::SCANS / 2);
    running.kill_supervisor();
    run.complete();
    assert_eq!(run.odometry(), undisturbed());
}

#[test]
fn a_recording_holds_what_was_used_and_replays_to_the_same_bytes() {
    let run = recorded(&with_gyro()).set("run.window=32");
    run.complete();
    assert_eq!(run.odometry(), undisturbed());
    // The log is not there any more, and its delay is in the samples already.
    assert_eq!(replay(&file(&run), &[]), undisturbed());
    let alone = replay(&file(&run), &["--set", "gyro.kind=none"]);
    assert_ne!(alone, undisturbed());
}

#[test]
fn a_log_of_another_time_is_refused() {
    let run = radar_alone().set("gyro.kind=auto").set("gyro.late_s=600");
    let words = ["has no sample while the scans were measured", "gyro.late_s"];
    run.finish().refused_with(&words);
}

#[test]
fn a_recording_without_a_log_is_refused() {
    let run = Run::of_recording().set("gyro.kind=auto");
    let words = ["no log of a gyro lies beside the scans", "gyro.kind"];
    run.finish().refused_with(&words);
}
