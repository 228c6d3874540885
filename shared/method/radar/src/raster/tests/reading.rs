//! Raster values against direct sums, on noise.

use super::scene::{Sensor, centre_m, raster};
use crate::raster::{RasterConfig, Rasteriser, Sampling};
use gyre_geometry::scan::OwnedScan;
use ndarray::Array2;
use std::f64::consts::TAU;

/// The mean of a row over a depth around a place, both in bins; zero outside the scan.
fn mean(row: &[u8], place: f64, depth: f64) -> f64 {
    let (start, end) = (place - 0.5 * depth, place + 0.5 * depth);
    let bins = start.max(0.0) as usize..(end.max(0.0).ceil() as usize).min(row.len());
    let covered = |bin: usize| ((bin + 1) as f64).min(end) - (bin as f64).max(start);
    bins.map(|bin| covered(bin) * f64::from(row[bin]))
        .sum::<f64>()
        / depth
}

fn between(row: &[u8], place: f64) -> f64 {
    let weight = |bin: usize| (1.0 - (place - 0.5 - bin as f64).abs()).max(0.0);
    let near = (place - 2.0).max(0.0) as usize..((place + 2.0).max(0.0) as usize).min(row.len());
    near.map(|bin| weight(bin) * f64::from(row[bin])).sum()
}

/// The raster by its definition: searches every azimuth, and sums every bin of the window.
fn direct(config: &RasterConfig, scan: &OwnedScan, depth_bins: Option<f64>) -> Vec<f64> {
    let view = scan.view();
    let count = view.azimuth_rad.len();
    let turns: Vec<f64> = view
        .azimuth_rad
        .iter()
        .map(|&a| f64::from(a) / TAU)
        .collect();
    let cell = |cell: usize| {
        let centre = centre_m(config, cell / config.n, cell % config.n);
        let range_m = centre.coords.norm();
        if range_m < f64::from(config.min_range_m) {
            return 0.0;
        }
        let bearing = (-centre.y).atan2(centre.x) / TAU;
        let past = |azimuth: usize| (bearing - turns[azimuth]).rem_euclid(1.0);
        let below = (0..count)
            .min_by(|&a, &b| past(a).total_cmp(&past(b)))
            .unwrap();
        let above = (below + 1) % count;
        let share = past(below) / (turns[above] - turns[below]).rem_euclid(1.0);
        let geometry = &scan.geometry;
        let place =
            (range_m - f64::from(geometry.range_offset_m)) / f64::from(geometry.range_resolution_m);
        let read = |azimuth| match depth_bins {
            Some(depth) => mean(view.row(azimuth), place, depth),
            None => between(view.row(azimuth), place),
        };
        read(below) * (1.0 - share) + read(above) * share
    };
    (0..config.n * config.n).map(cell).collect()
}

/// Random powers at irregular azimuths, with a range within the raster.
fn noise(range_resolution_m: f32, bins: usize) -> OwnedScan {
    let mut sensor = Sensor {
        bins,
        range_resolution_m,
        range_offset_m: -0.31,
        ..Sensor::navtech()
    };
    for (i, azimuth) in sensor.azimuth_rad.iter_mut().enumerate() {
        *azimuth += 0.001 * (i as f32 * 1.7).sin();
    }
    let mut scan = sensor.scan();
    let mut state = 7u32;
    scan.bytes.fill_with(|| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 24) as u8
    });
    scan
}

fn difference(got: &[f32], expected: &[f64]) -> (f64, f64) {
    let errors = got
        .iter()
        .zip(expected)
        .map(|(&got, expected)| (f64::from(got) - expected).abs());
    let (squares, largest) = errors.fold((0.0, 0.0f64), |(sum, largest), e| {
        (sum + e * e, largest.max(e))
    });
    ((squares / got.len() as f64).sqrt(), largest)
}

fn config(n: usize, sampling: Sampling) -> RasterConfig {
    RasterConfig {
        sampling,
        ..RasterConfig::of(n, 0.8)
    }
}

#[test]
fn rasters_equal_direct_interpolation_or_the_direct_mean() {
    // The mean is 127, with a standard deviation of 17 or more between cells; only the ends of the
    // windows differ.
    for (sampling, resolution_m, bins, limits) in [
        (Sampling::Bilinear, 0.0438, 1100, [0.05, 1.5]),
        (Sampling::Bilinear, 0.1736, 300, [0.05, 1.5]),
        (Sampling::Averaged, 0.0438, 1100, [2.5, 20.0]),
        (Sampling::Averaged, 0.0596, 800, [2.5, 20.0]),
    ] {
        let (config, scan) = (config(127, sampling), noise(resolution_m, bins));
        let depth = (sampling == Sampling::Averaged).then_some(config.cell_m / resolution_m);
        let expected = direct(&config, &scan, depth.map(f64::from));
        let (rms, largest) = difference(&raster(&config, &scan, None), &expected);
        assert!(
            rms < limits[0] && largest < limits[1],
            "{sampling:?}, {resolution_m} m: {rms}, maximum {largest}"
        );
    }
}

#[test]
fn only_power_above_the_floor_counts() {
    let config = config(127, Sampling::Averaged);
    let mut scan = noise(0.0438, 1500);
    let mut floored = Array2::zeros((config.n, config.n));
    let mut rasteriser = Rasteriser::new(&config).unwrap();
    rasteriser
        .rasterise(&scan.view(), 60, None, floored.view_mut())
        .unwrap();
    scan.bytes
        .iter_mut()
        .for_each(|power| *power = power.saturating_sub(60));
    assert_eq!(floored.as_slice().unwrap(), raster(&config, &scan, None));
    rasteriser
        .rasterise(&scan.view(), 255, None, floored.view_mut())
        .unwrap();
    assert!(floored.iter().all(|&power| power == 0.0));
}
