//! A vehicle that stops, stands and drives off: the run reports it.

use std::{fmt::Write, path::PathBuf};

use crate::{
    common::{self, Run, odometry::columns},
    method::in_process,
};

/// Poses a second of the trajectory.
const RATE_HZ: usize = 4;
/// Length of the drive, s.
const DRIVE_S: usize = 14;
/// The motions between the stop and the start.
const STANDING: std::ops::Range<usize> = 3 * RATE_HZ..11 * RATE_HZ;

/// Brakes from 6 m/s for 3 s, stands for 8 s, and drives off at 2 m/s².
fn trajectory() -> String {
    let speed_mps = |second: f64| match second {
        ..3.0 => 6.0 - 2.0 * second,
        11.0.. => 2.0 * (second - 11.0),
        _ => 0.0,
    };
    const FINE: usize = 100;
    let (mut text, mut x_m) = (String::new(), 0.0);
    for k in 0..=DRIVE_S * RATE_HZ * FINE {
        let second = k as f64 / (RATE_HZ * FINE) as f64;
        if k % FINE == 0 {
            let _ = writeln!(text, "{second} {x_m} 0 0 0 0 0 1");
        }
        x_m += speed_mps(second) / (RATE_HZ * FINE) as f64;
    }
    text
}

pub const SCANS: usize = DRIVE_S * RATE_HZ;

pub fn recording() -> PathBuf {
    common::recording::along("stop-and-go", &trajectory())
}

#[test]
fn the_motions_of_a_standing_vehicle_are_zero_and_said_to_be() {
    let run = Run::small().data(&recording());
    // One process holds the pose as the run does.
    assert_eq!(in_process::assert_same_bits(&run), SCANS);
    let rows = columns(&run.odometry(), &["stationary", "x_m", "y_m", "yaw_rad"]);
    let standing: Vec<usize> = (0..rows.len()).filter(|row| rows[*row][0] == "1").collect();
    assert_eq!(run.summary()["motions"]["stationary"], standing.len());
    assert!(standing.len() > STANDING.len() * 9 / 10, "{standing:?}");
    let stop_to_start = STANDING.start - 2..STANDING.end + 2;
    for row in standing {
        assert!(stop_to_start.contains(&row), "{row}");
        assert_eq!(rows[row][1..], ["0.000000000"; 3]);
    }
}
