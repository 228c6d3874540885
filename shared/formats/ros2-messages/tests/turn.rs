//! A small radar, and the scans of its turns as a reader of recordings gives them. The tests of
//! bags, and of their fuzzing, take it from here.

use gyre_colossus::Configuration;
use gyre_geometry::{OwnedScan, SweepGeometry};

pub const START_NS: i64 = 1_549_986_608_000_000_007;
pub const TURN_NS: i64 = 250_000_000;
pub const AZIMUTHS: usize = 40;
pub const BINS: usize = 64;

pub fn radar() -> Configuration {
    Configuration {
        range_resolution_m: Some(0.0438),
        ..Configuration::usual(AZIMUTHS as u16, BINS as u16)
    }
}

pub fn scan(turn: usize) -> OwnedScan {
    let mut scan = OwnedScan::of(SweepGeometry {
        azimuths: AZIMUTHS,
        bins: BINS,
        stride: BINS,
        range_resolution_m: 0.0438,
        ..SweepGeometry::default()
    });
    for row in 0..AZIMUTHS {
        let encoder = (140 * row + 13) as f64;
        scan.azimuth_rad[row] = (encoder * (std::f64::consts::TAU / 5600.0)) as f32;
        scan.stamp_ns[row] = START_NS + TURN_NS * turn as i64 + 6_250_000 * row as i64;
        for bin in 0..BINS {
            scan.bytes[row * BINS + bin] = (turn * 31 + row * 7 + bin * bin) as u8;
        }
    }
    let (first_ns, last_ns) = (scan.stamp_ns[0], scan.stamp_ns[AZIMUTHS - 1]);
    scan.geometry.stamp_ns = first_ns + (last_ns - first_ns) / 2;
    scan
}
