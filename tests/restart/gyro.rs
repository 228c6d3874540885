//! Runs with a gyro and wheels: their samples travel with the scans, so that no kill, rate or
//! replay changes a byte.

use std::path::PathBuf;

use gyre_simulator::{GyroProfile, OutputFormat, Profile, SimulationConfig};

use super::{assert_same_after_kills, assert_same_when_continued};
use crate::{
    common::{Run, STAGES, recording},
    observers::record::{file, recorded, replay},
};

/// Time by which the log is late, s.
const LATE_S: f64 = 0.75;

/// Time by which that of the wheels is, s.
const WHEELS_LATE_S: f64 = 0.2;

/// A recording as RADIATE has them, with the log of a gyro whose clock is late and whose host
/// stalls and loses samples, and that of wheels, which slip; the radar is blind for a while.
fn with_log() -> PathBuf {
    let mut config = SimulationConfig {
        scans: Some(recording::SCANS),
        ..SimulationConfig::default()
    };
    config.sensor.profile = Profile::Cts350xRadiate;
    config.output.format = Some(OutputFormat::Radiate);
    config.drive.speed_mps = 5.0;
    config.sensor.lost_azimuths = true;
    config.gyro.profile = GyroProfile::Asm330lhh;
    config.gyro.late_s = LATE_S;
    config.gyro.faults = true;
    config.wheels.rate_hz = 20.0;
    config.wheels.late_s = WHEELS_LATE_S;
    config.wheels.faults = true;
    config.blind_s = Some([2.5, 4.0]);
    recording::of("gyro-and-wheels", &config)
}

fn radar_alone() -> Run {
    Run::small().data(&with_log())
}

fn with_gyro() -> Run {
    let run = radar_alone().set("gyro.kind=auto");
    run.set(&format!("gyro.late_s={LATE_S}"))
}

fn with_both() -> Run {
    let run = with_gyro().set("wheels.kind=auto");
    run.set(&format!("wheels.late_s={WHEELS_LATE_S}"))
}

/// The undisturbed result.
fn undisturbed() -> String {
    let run = with_both();
    run.complete();
    let summary = run.summary();
    let gyro = &summary["gyro"];
    assert!(gyro["motions"].as_u64() > Some(15), "{gyro}");
    let wheels = &summary["wheels"];
    assert!(wheels["motions"].as_u64() > Some(15), "{wheels}");
    assert!(wheels["predicted"].as_u64() > Some(3), "{wheels}");
    run.odometry()
}

#[test]
fn whatever_is_killed_the_result_is_the_undisturbed_one() {
    let undisturbed = undisturbed();
    let (alone, by_gyro) = (radar_alone(), with_gyro());
    // Where the radar is blind nothing else measures.
    alone.complete();
    assert!(alone.summary()["motions"]["predicted"].as_u64() > Some(5));
    assert_ne!(alone.odometry(), undisturbed);
    by_gyro.complete();
    assert_ne!(by_gyro.odometry(), undisturbed);
    assert!(by_gyro.summary().get("wheels").is_none());
    assert_same_after_kills(with_both, &undisturbed);
}

#[test]
fn a_run_that_is_continued_has_the_same_result() {
    assert_same_when_continued(with_both, &undisturbed());
}

#[test]
#[ignore = "nightly: a hundred runs"]
fn a_hundred_kills_of_any_process_change_no_byte() {
    let undisturbed = undisturbed();
    for kill in 0..100 {
        let run = with_both().rate("6");
        let mut running = run.start();
        // Each process at one moment of the drive after the other.
        let poses = 1 + kill * (recording::SCANS - 4) / 100;
        running.await_poses(poses);
        match STAGES.get(kill % (STAGES.len() + 1)) {
            Some(stage) => {
                running.kill(stage);
                running.finish().succeeded();
            }
            None => {
                running.kill_supervisor();
                run.complete();
            }
        }
        assert_eq!(
            run.odometry(),
            undisturbed,
            "kill {kill}, after {poses} poses"
        );
    }
}

#[test]
fn a_recording_holds_what_was_used_and_replays_to_the_same_bytes() {
    let run = recorded(&with_both()).set("run.window=32");
    run.complete();
    assert_eq!(run.odometry(), undisturbed());
    // The logs are not there any more, and their delays are in the samples already.
    assert_eq!(replay(&file(&run), &[]), undisturbed());
    let by_gyro = with_gyro();
    by_gyro.complete();
    let without = replay(&file(&run), &["--set", "wheels.kind=none"]);
    assert_eq!(without, by_gyro.odometry());
}

#[test]
fn a_log_of_the_wheels_of_another_time_or_without_speeds_is_refused() {
    let run = with_both().set("wheels.late_s=600");
    let words = ["the log of the wheels", "wheels.late_s is wrong"];
    run.finish().refused_with(&words);
    let log = with_log().join("imu.csv");
    let run = radar_alone().set("wheels.kind=log");
    let run = run.set(&format!("wheels.file='{}'", log.display()));
    let words = ["is no log of the wheels", "stamp_ns,speed_m_s"];
    run.finish().refused_with(&words);
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
    let run = Run::of_recording().set("wheels.kind=auto");
    let words = ["no log of the wheels lies beside the scans", "wheels.kind"];
    run.finish().refused_with(&words);
}
