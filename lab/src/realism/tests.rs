//! Drawn scans.

#![allow(clippy::unwrap_used)]

mod comparison;
mod powers;
mod texture;

use super::{
    grid::{RangeGrid, resample},
    histogram::Histogram,
    sample::Sample,
    statistics::Statistics,
};
use gyre_radar::{OwnedScan, ScanLimits, Sense, SweepGeometry};
use nalgebra::{Isometry2, Point2};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

pub const AZIMUTHS: usize = 400;
pub const BINS: usize = 250;
pub const RESOLUTION_M: f32 = 0.2;
pub const PERIOD_NS: i64 = 250_000_000;

/// The grid that the drawn scans are on already.
pub const GRID: RangeGrid = RangeGrid {
    resolution_m: RESOLUTION_M,
    cells: BINS,
};

/// A scan with these powers by azimuth and bin, the `index`-th of its recording.
pub fn scan(
    azimuths: usize,
    bins: usize,
    index: i64,
    power: impl FnMut(usize, usize) -> u8,
) -> OwnedScan {
    let mut scan = OwnedScan::with_limits(ScanLimits {
        bytes: azimuths * bins,
        azimuths,
    });
    let stamp_ns = index * PERIOD_NS;
    scan.geometry = SweepGeometry {
        azimuths,
        bins,
        stride: bins,
        first_byte: 0,
        range_resolution_m: RESOLUTION_M,
        range_offset_m: 0.0,
        doppler_s: 0.0,
        sense: Sense::Clockwise,
        stamp_ns,
    };
    for azimuth in 0..azimuths {
        let turn = azimuth as f64 / azimuths as f64;
        scan.azimuth_rad[azimuth] = (turn * std::f64::consts::TAU) as f32;
        scan.stamp_ns[azimuth] = stamp_ns + ((turn - 0.5) * PERIOD_NS as f64) as i64;
    }
    let mut power = power;
    for (place, byte) in scan.bytes.iter_mut().enumerate() {
        *byte = power(place / bins, place % bins);
    }
    scan
}

/// Returns independent powers from 0 to `most`.
pub fn noise(seed: u64, most: u8) -> Vec<u8> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    (0..AZIMUTHS * BINS)
        .map(|_| random.random_range(0..=most))
        .collect()
}

/// A scan of posts, each a few bins deep and three azimuths wide, by a sensor that is at
/// `pose(seconds since its stamp)`.
pub fn posts(posts: &[Point2<f64>], index: i64, pose: impl Fn(f64) -> Isometry2<f64>) -> OwnedScan {
    let mut drawn = scan(AZIMUTHS, BINS, index, |_, _| 0);
    for azimuth in 0..AZIMUTHS {
        let pose = pose((drawn.stamp_ns[azimuth] - drawn.geometry.stamp_ns) as f64 * 1e-9);
        for post in posts {
            let seen = pose.inverse() * post;
            let clockwise = -seen.y.atan2(seen.x);
            let off = (clockwise - f64::from(drawn.azimuth_rad[azimuth]))
                .rem_euclid(std::f64::consts::TAU);
            let off = off.min(std::f64::consts::TAU - off);
            let bin = (seen.coords.norm() / f64::from(RESOLUTION_M)) as usize;
            if off < 1.5 * std::f64::consts::TAU / AZIMUTHS as f64 && bin >= 2 && bin + 2 < BINS {
                drawn.bytes[azimuth * BINS + bin - 1..=azimuth * BINS + bin + 1].fill(200);
            }
        }
    }
    drawn
}

/// A scan on the grid, with its motion since the one before it.
pub fn sample(scan: &OwnedScan, motion: Option<Isometry2<f64>>) -> Sample {
    Sample {
        scan: resample(&scan.view(), GRID).unwrap(),
        motion,
    }
}

/// Measures scans without known motions.
pub fn measured<'s>(scans: impl IntoIterator<Item = &'s OwnedScan>) -> Statistics {
    let mut raw = Histogram::default();
    let scans = scans.into_iter().inspect(|scan| raw.add(&scan.view()));
    let samples: Vec<Sample> = scans.map(|scan| sample(scan, None)).collect();
    Statistics::of(&samples, &raw, GRID).unwrap()
}
