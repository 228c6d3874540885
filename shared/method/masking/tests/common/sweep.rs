//! An empty scan.

use gyre_geometry::{OwnedScan, SweepGeometry};

/// A scan without power of evenly spaced azimuths, in a sweep of 0.625 ms a row.
pub fn of(azimuths: usize, bins: usize, range_resolution_m: f32) -> OwnedScan {
    let mut scan = OwnedScan::of(SweepGeometry {
        azimuths,
        bins,
        stride: bins,
        range_resolution_m,
        doppler_s: 0.04,
        ..SweepGeometry::default()
    });
    for azimuth in 0..azimuths {
        scan.azimuth_rad[azimuth] = azimuth as f32 * std::f32::consts::TAU / azimuths as f32;
        scan.stamp_ns[azimuth] = (azimuth as i64 - azimuths as i64 / 2) * 625_000;
    }
    scan
}
