//! Runs with the velocity by Doppler: it is of each scan alone, so that no kill, rate or replay
//! changes a byte.

use std::path::PathBuf;

use gyre_simulator::{OutputFormat, Profile, SimulationConfig};

use super::{assert_same_after_kills, assert_same_when_continued};
use crate::{
    common::{Run, recording},
    observers::record::{file, recorded, replay},
};

/// A recording of a radar whose chirps alternate, in a tunnel from the third second on.
fn in_a_tunnel() -> PathBuf {
    let mut config = SimulationConfig {
        scans: Some(recording::SCANS),
        ..SimulationConfig::default()
    };
    config.sensor.profile = Profile::Ras6;
    config.output.format = Some(OutputFormat::Boreas);
    config.drive.speed_mps = 8.0;
    config.tunnel_m = Some([24.0, 100.0]);
    recording::of("chirps-alternate", &config)
}

fn radar_alone() -> Run {
    Run::small().data(&in_a_tunnel())
}

fn with_doppler() -> Run {
    radar_alone().set("doppler.kind=auto")
}

/// The undisturbed result.
fn undisturbed() -> String {
    let run = with_doppler();
    run.complete();
    let doppler = &run.summary()["doppler"];
    assert!(doppler["motions"].as_u64() > Some(15), "{doppler}");
    run.odometry()
}

#[test]
#[ignore = "nightly: kills at many moments"]
fn whatever_is_killed_the_result_is_the_undisturbed_one() {
    let undisturbed = undisturbed();
    let alone = radar_alone();
    alone.complete();
    assert_ne!(alone.odometry(), undisturbed);
    assert!(alone.summary().get("doppler").is_none());
    assert_same_after_kills(with_doppler, &undisturbed);
}

#[test]
fn a_run_that_is_continued_has_the_same_result() {
    assert_same_when_continued(with_doppler, &undisturbed());
}

#[test]
#[ignore = "nightly: a drive in several runs"]
fn a_recording_replays_to_the_same_bytes_with_and_without() {
    let run = recorded(&with_doppler()).set("run.window=32");
    run.complete();
    assert_eq!(run.odometry(), undisturbed());
    assert_eq!(replay(&file(&run), &[]), undisturbed());
    let alone = radar_alone();
    alone.complete();
    let without = replay(&file(&run), &["--set", "doppler.kind=none"]);
    assert_eq!(without, alone.odometry());
}

#[test]
fn a_radar_that_does_not_say_it_is_refused() {
    let run = Run::of_recording().set("doppler.kind=auto");
    let words = ["the radar does not say which azimuths", "doppler.kind"];
    run.finish().refused_with(&words);
    let run = with_doppler().set("dataset.doppler_s=0");
    let words = ["the Doppler coefficient", "dataset.doppler_s"];
    run.finish().refused_with(&words);
}
