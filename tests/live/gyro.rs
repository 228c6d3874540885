//! A live radar with a live gyro and live wheels, whose samples arrive in datagrams.

use std::{
    fs,
    net::UdpSocket,
    path::Path,
    process,
    thread::{self, JoinHandle},
    time::Duration,
};

use gyre_datasets::read_trajectory;
use gyre_geometry::{interpolate, pose};
use serde_json::Value;
use tempfile::TempDir;

use super::radar::{Radar, complete};
use crate::{
    common::{Run, finished, recording},
    observers::record::{file, recorded, replay},
};

pub const SCANS: usize = 12;

/// A recording with the logs of a gyro and of wheels. All its rows are measured, because a radar
/// sends no others.
pub fn with_log() -> TempDir {
    let sensors = "gyro.profile = 'asm330lhh'\nwheels.rate_hz = 20.0\n";
    let settings = format!("scans = {SCANS}\n{}{sensors}", recording::SENSOR);
    let drive = recording::configured("live-gyro", &settings);
    complete(recording::linked(&drive, |_| true))
}

/// A sensor that sends lines once somebody receives them, in datagrams of ten with this pause.
pub fn sending(lines: Vec<String>, address: String, pause_ms: u64) -> JoinHandle<()> {
    thread::spawn(move || {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        socket.connect(&address).unwrap();
        // While nobody receives, each send reports the failure of the send before. The run tries
        // its addresses for a moment before it receives.
        let probe = || {
            (0..3).try_for_each(|_| {
                thread::sleep(Duration::from_millis(5));
                socket.send(b"").map(drop)
            })
        };
        while probe().is_err() {}
        for datagram in lines.chunks(10) {
            socket.send(datagram.join("\n").as_bytes()).unwrap();
            thread::sleep(Duration::from_millis(pause_ms));
        }
    })
}

/// Returns the lines of a log without its header, and one that is no measurement.
pub fn lines_of(log: &str) -> Vec<String> {
    let lines = log.lines().skip(1).chain(["hello"]);
    lines.map(str::to_owned).collect()
}

/// Returns an address that stays free: senders take their ports on 127.0.0.1.
pub fn address(test: u32) -> String {
    let port = 40_000 + test * 3_500 + process::id() % 3_500;
    format!("127.0.0.2:{port}")
}

fn recorded_with_logs(recording: &Path) -> String {
    let run = Run::small().data(recording);
    run.sets("gyro.kind=auto wheels.kind=auto").complete()
}

#[test]
fn a_live_gyro_and_wheels_give_the_motions_of_their_logs_and_the_recording_replays_to_them() {
    let whole = with_log();
    let expected = recorded_with_logs(whole.path());
    let alone = Run::small().data(whole.path()).complete();
    assert_ne!(expected, alone);
    let [of_gyro, of_wheels] = [0, 2].map(address);
    let radar = Radar::playing(whole.path(), &[]);
    let run = recorded(&radar.run(SCANS))
        .sets("gyro.kind=udp wheels.kind=udp run.window=32")
        .sets(&format!(
            "gyro.listen='{of_gyro}' wheels.listen='{of_wheels}'"
        ));
    let sensors = [("imu.csv", of_gyro), ("wheels.csv", of_wheels)];
    let sensors = sensors.map(|(log, address)| {
        let log = fs::read_to_string(whole.path().join(log)).unwrap();
        sending(lines_of(&log), address, 0)
    });
    let live = run.complete();
    for sensor in sensors {
        sensor.join().unwrap();
    }
    run.assert_counts("dropped=0 gyro/motions=11 wheels/motions=11");
    assert!(live == expected, "{live}\n{expected}");
    assert_eq!(replay(&file(&run), &[]), expected);
}

#[test]
fn between_the_scans_poses_are_predicted_at_their_rate_and_lead_to_the_next_pose() {
    let whole = with_log();
    let listen = address(5);
    let radar = Radar::playing(whole.path(), &[]);
    let run = radar.run(SCANS).sets(&format!(
        "gyro.kind=udp gyro.listen='{listen}' run.window=32 run.predict_hz=50"
    ));
    let log = fs::read_to_string(whole.path().join("imu.csv")).unwrap();
    let gyro = sending(lines_of(&log), listen, 1);
    let running = run.started(3);
    let echoed = finished!["echo", run.out(), "predicted_pose", "--json"];
    running.finish().succeeded();
    gyro.join().unwrap();
    let message = |line: &str| serde_json::from_str::<Value>(line).unwrap();
    let messages: Vec<Value> = echoed.succeeded().stdout.lines().map(message).collect();
    // Of the two seconds that are left.
    assert!(messages.len() > 40, "{}", messages.len());
    let poses = read_trajectory(&run.out().join("trajectory.tum")).unwrap();
    let stamps = poses.stamp_ns.unwrap();
    for pair in messages.windows(2) {
        let [before, message] = [0, 1].map(|k| pair[k]["item"]["seq"].as_u64().unwrap());
        assert_eq!(message, before + 1);
    }
    let mut compared = 0;
    for message in &messages {
        let number = |key: &str| message[key].as_f64().unwrap();
        let at_ns = message["item"]["stamp_ns"].as_i64().unwrap();
        let next = stamps.partition_point(|ns| *ns <= at_ns);
        let (Some(from), Some(to)) = (poses.poses.get(next - 1), poses.poses.get(next)) else {
            continue;
        };
        let share = (at_ns - stamps[next - 1]) as f64 / (stamps[next] - stamps[next - 1]) as f64;
        let expected = interpolate(from, to, share);
        let apart = expected.inv_mul(&pose(number("x_m"), number("y_m"), number("yaw_rad")));
        let variance = |k: usize| message["covariance"][k].as_f64().unwrap();
        let sigma_m = (variance(0) + variance(3)).sqrt();
        let apart_m = apart.translation.vector.norm();
        assert!(
            apart_m < 0.1 + 4.0 * sigma_m,
            "{at_ns}: {apart_m} m, {sigma_m} m"
        );
        compared += 1;
    }
    assert!(compared > 30, "{compared}");
}

#[test]
fn a_live_gyro_that_is_silent_leaves_the_radar_alone() {
    let whole = with_log();
    let radar = Radar::playing(whole.path(), &[]);
    let listen = format!("gyro.kind=udp gyro.listen='{}'", address(1));
    let run = radar.run(SCANS).sets(&listen);
    run.finish().failed_with(&["gyro.kind is set, but none of"]);
    let live = run.odometry();
    assert!(live == Run::small().data(whole.path()).complete(), "{live}");
    assert!(run.summary().get("gyro").is_none());
}

#[test]
fn a_log_beside_a_live_radar_is_refused() {
    let radar = Radar::playing(recording::small(), &[]);
    for sensor in ["gyro.kind", "wheels.kind"] {
        let run = radar.run(SCANS).set(&format!("{sensor}=auto"));
        run.finish()
            .refused_with(&[sensor, "the radar is live", "`udp`"]);
    }
}
