//! Odometry of a radar that Gyre has no reader for: each of its sweeps is an array of powers.
//!
//! ```sh
//! cargo run --release -p gyre-matching --example own_sensor
//! ```
//!
//! Here the sweeps are computed, of a sensor that drives 2 m ahead in each. Yours come from a
//! driver: all but `sweep` stays.

use std::{error::Error, f32::consts::TAU};

use gyre_geometry::{PolarScan, Sense, SweepGeometry, scan::flag};
use gyre_matching::odometry::{Odometry, OdometryConfig, Registered};

const AZIMUTHS: usize = 400;
const BINS: usize = 720;
const BIN_M: f32 = 0.125;
const SWEEP_NS: i64 = 250_000_000;
const STEP_M: f32 = 2.0;

fn main() -> Result<(), Box<dyn Error>> {
    for registered in drive(20)? {
        let (outcome, pose) = (registered.outcome, registered.pose.motion);
        println!("{} {outcome:?} {pose}", registered.seq);
    }
    Ok(())
}

/// Registers sweeps, whose memory is borrowed.
pub(crate) fn drive(sweeps: i64) -> Result<Vec<Registered>, Box<dyn Error>> {
    let mut config = OdometryConfig::default();
    config.masking.threshold = 60;
    let mut odometry = Odometry::new(&config)?;
    let share = |azimuth| azimuth as f32 / AZIMUTHS as f32;
    let azimuth_rad: Vec<f32> = (0..AZIMUTHS).map(|azimuth| share(azimuth) * TAU).collect();
    let register = |number| {
        let time_ns = |azimuth| number * SWEEP_NS + azimuth * SWEEP_NS / AZIMUTHS as i64;
        let stamp_ns: Vec<i64> = (0..AZIMUTHS as i64).map(time_ns).collect();
        let scan = PolarScan {
            geometry: SweepGeometry {
                azimuths: AZIMUTHS,
                bins: BINS,
                stride: BINS,
                first_byte: 0,
                range_resolution_m: BIN_M,
                range_offset_m: 0.0,
                doppler_s: 0.0,
                sense: Sense::Clockwise,
                stamp_ns: stamp_ns[AZIMUTHS / 2],
            },
            bytes: &sweep(number),
            azimuth_rad: &azimuth_rad,
            stamp_ns: &stamp_ns,
            flags: &[flag::MEASURED; AZIMUTHS],
        };
        Ok(odometry.register(&scan, &[])?)
    };
    (0..sweeps).map(register).collect()
}

/// Returns the powers of a sweep, azimuth x range bin: 800 reflectors on the ground, and noise.
fn sweep(number: i64) -> Vec<u8> {
    let place_m = |index| (noise(index) - 0.5) * 180.0;
    let seed = (number as usize + 1) << 32;
    let mut power: Vec<u8> = (0..AZIMUTHS * BINS)
        .map(|index| (noise(seed + index) * 40.0) as u8)
        .collect();
    for reflector in 0..800 {
        let x_m = place_m(2 * reflector) - STEP_M * number as f32;
        let y_m = place_m(2 * reflector + 1);
        let turn = (-y_m).atan2(x_m).rem_euclid(TAU) / TAU; // clockwise
        let x_m = x_m - STEP_M * (turn - 0.5); // where the sensor is when it looks there
        let azimuth = (turn * AZIMUTHS as f32).round() as usize;
        let bin = (x_m.hypot(y_m) / BIN_M) as usize;
        for (beam, strength) in [(AZIMUTHS - 1, 120), (1, 120), (0, 200)] {
            if bin < BINS {
                power[(azimuth + beam) % AZIMUTHS * BINS + bin] = strength;
            }
        }
    }
    power
}

/// Returns a number from 0 to 1 that looks random.
fn noise(index: usize) -> f32 {
    let mixed = (index as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    (mixed >> 40) as f32 / (1 << 24) as f32
}
