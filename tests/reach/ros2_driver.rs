//! A run that receives a radar from its driver in ROS 2, which a peer plays that is not Gyre's own
//! (Cyclone DDS).

use std::{
    fs,
    path::{Path, PathBuf},
};

use crate::{
    common::{Run, odometry, recording, recording::with_constants},
    live::{
        gnss,
        gyro::{SCANS, with_log},
        radar::{Radar, whole},
    },
    observers::record::recorded,
    reach::{
        only_if,
        ros2::{Program, can_speak, domain},
    },
};

/// The topic of a driver's azimuths.
const FFT_DATA: &str = "/radar_data/fft_data";
/// The topic of a driver's turns.
const B_SCANS: &str = "/radar_data/b_scan_msg";

/// A radar of a recording, behind a driver in ROS 2.
struct Driver {
    _driver: Program,
    _radar: Radar,
}

impl Driver {
    /// Plays a recording, beside a gyro, wheels and a GNSS receiver that publish what their logs
    /// hold.
    fn playing(
        recording: &Path,
        domain: &str,
        publishes: &str,
        options: &[&str],
        logs: &[PathBuf],
    ) -> Self {
        // At the radar's own rate, unless the options have another.
        let radar = Radar::playing(recording, &[&["--rate", "1"], options].concat());
        let mut arguments = vec![domain, &radar.address, publishes];
        arguments.extend(logs.iter().filter_map(|log| log.to_str()));
        let driver = Program::peer("driver.py", &arguments);
        Self {
            _driver: driver,
            _radar: radar,
        }
    }
}

/// A run that receives so many scans from a topic in a domain.
fn receiving(run: Run, domain: &str, topic: &str, scans: usize) -> Run {
    run.argument("--ros2", topic).sets(&format!(
        "source.interface='127.0.0.1' source.domain={domain} source.scans={scans}"
    ))
}

/// Of a driver as it is, of one before 2024, and of one that publishes whole turns.
#[test]
#[ignore = ".ci/nightly: three drivers"]
fn a_radar_behind_its_driver_gives_the_motions_of_the_recording() {
    only_if!(can_speak());
    let scans = recording::SCANS / 2;
    let whole = whole(scans);
    let recorded = Run::small().data(whole.path()).complete();
    for (publishes, topic, of) in [
        ("configured", FFT_DATA, 2),
        ("older", FFT_DATA, 5),
        ("turns", B_SCANS, 6),
    ] {
        let domain = domain(of);
        let _driver = Driver::playing(whole.path(), &domain, publishes, &[], &[]);
        let run = receiving(with_constants(Run::small()), &domain, topic, scans);
        let live = run.complete();
        let losses = "missing_azimuths damaged_messages scans_left_out reconnections";
        for lost in losses.split(' ') {
            let key = format!("stages/radar-replay/{lost}");
            assert_eq!(run.count(&key), 0, "{publishes}: {lost}");
        }
        run.assert_counts("dropped=0");
        assert!(live == recorded, "{publishes}: {live}\n{recorded}");
    }
}

#[test]
#[ignore = ".ci/nightly: six seconds of azimuths"]
fn the_azimuths_of_a_driver_that_publishes_no_configuration_tell_it() {
    only_if!(can_speak());
    let domain = domain(3);
    let _driver = Driver::playing(recording::small(), &domain, "silent", &["--repeat"], &[]);
    let run = receiving(with_constants(Run::small()), &domain, FFT_DATA, 6);
    let motions = odometry::rows(&run.complete());
    assert_eq!(motions.len(), 5);
    odometry::assert_unbroken(&motions);
    let log = run.result("log.jsonl");
    assert!(log.contains("it was found from azimuths"), "{log}");
}

#[test]
fn a_gyro_and_wheels_beside_the_driver_are_used() {
    only_if!(can_speak());
    let whole = with_log();
    let logs = ["imu.csv", "wheels.csv"].map(|log| whole.path().join(log));
    let domain = domain(9);
    let _driver = Driver::playing(whole.path(), &domain, "configured", &[], &logs);
    let run = receiving(with_constants(Run::small()), &domain, FFT_DATA, SCANS);
    let run = run.sets("gyro.kind=ros2 gyro.max_wait_ms=200 wheels.kind=ros2");
    // Its odometry would be its wheels.
    let mut bridge = Program::bridge(&run, &domain, &[]);
    let live = run.complete();
    bridge.await_words("is not published: it receives its wheels from /odom");
    let used = ["gyro", "wheels"].map(|of| run.count(&format!("{of}/motions")) as usize);
    assert!(used.iter().all(|used| *used > SCANS / 2));
    if used == [SCANS - 1; 2] {
        let recorded = Run::small().data(whole.path()).set("gyro.kind=auto");
        assert!(live == recorded.set("wheels.kind=auto").complete());
    }
}

#[test]
#[ignore = ".ci/nightly: a drive with GNSS"]
fn a_gnss_receiver_beside_the_driver_corrects_the_trajectory() {
    only_if!(can_speak());
    let drive = gnss::drive();
    let log = drive.path().join("fixes.csv");
    fs::write(&log, gnss::log_of_drive()).unwrap();
    let logs = ["/dev/null".into(), "/dev/null".into(), log];
    let domain = domain(11);
    let _driver = Driver::playing(drive.path(), &domain, "configured", &[], &logs);
    let run = receiving(with_constants(Run::small()), &domain, FFT_DATA, gnss::SCANS);
    let run = recorded(&gnss::with_graph(run)).sets("gnss.kind=ros2 gnss.topic='/fix'");
    run.complete();
    let gnss = run.summary()["gnss"].clone();
    let fixes = gnss["fixes"].as_u64().unwrap() as usize;
    assert!(fixes > gnss::FIXES * 3 / 4, "{gnss}: some may be lost");
    assert!(gnss["used"].as_u64().unwrap() > 20, "{gnss}");
    gnss::assert_replays(&run);
}

#[test]
fn a_run_waits_for_a_topic_that_nobody_publishes() {
    let run = receiving(Run::small(), &domain(4), FFT_DATA, 4);
    let mut running = run.start();
    running.await_words("waits for its radar: nobody publishes /radar_data/fft_data in domain");
    running.interrupt();
}
