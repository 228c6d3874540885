//! Scatterers appear in the raster at their true positions.

use super::scene::{Sensor, centre_m, miss_cells, raster};
use crate::raster::{RasterConfig, Sampling};
use gyre_geometry::scan::Sense;
use nalgebra::Point2;
use proptest::prelude::*;
use std::f64::consts::TAU;

const SIGMA_M: f64 = 1.0;

/// Ahead (between the last and the first azimuth), left, right, behind, near and far.
fn places() -> Vec<Point2<f64>> {
    [
        (30.0, 0.3),
        (8.0, -6.0),
        (-20.0, 15.0),
        (-35.0, -0.2),
        (0.4, 40.0),
        (3.0, -44.0),
        (38.0, 33.0),
    ]
    .map(|(x, y)| Point2::new(x, y))
    .to_vec()
}

fn check(config: &RasterConfig, sensor: &Sensor, tolerance_cells: f64) {
    let places = places();
    let raster = raster(config, &sensor.measure(&places, SIGMA_M), None);
    for place in &places {
        let miss = miss_cells(config, &raster, place, 4.0 * SIGMA_M);
        assert!(
            miss < tolerance_cells,
            "{config:?}, {:?}: {place} is off by {miss} cells",
            sensor.sense
        );
    }
}

fn config(n: usize, sampling: Sampling) -> RasterConfig {
    RasterConfig {
        n,
        cell_m: 102.0 / n as f32,
        sampling,
        ..RasterConfig::default()
    }
}

#[test]
fn scatterers_are_placed_for_both_senses_and_samplings_and_offsets() {
    for sense in [Sense::Clockwise, Sense::CounterClockwise] {
        for sampling in [Sampling::Averaged, Sampling::Bilinear] {
            for range_offset_m in [0.0, -0.31, 2.5] {
                let sensor = Sensor {
                    sense,
                    range_offset_m,
                    ..Sensor::navtech()
                };
                check(&config(255, sampling), &sensor, 0.04);
            }
        }
    }
}

#[test]
fn scatterers_are_placed_at_every_size() {
    for n in [127, 128, 254, 255, 256, 511] {
        check(&config(n, Sampling::Averaged), &Sensor::navtech(), 0.06);
    }
}

#[test]
fn a_row_to_the_right_is_drawn_to_the_right() {
    let config = RasterConfig {
        n: 51,
        cell_m: 1.0,
        ..RasterConfig::default()
    };
    for (sense, column) in [(Sense::Clockwise, 45), (Sense::CounterClockwise, 5)] {
        let sensor = Sensor {
            sense,
            ..Sensor::navtech()
        };
        let mut scan = sensor.scan();
        let quarter = 99; // at 89.9 degrees
        let first = scan.geometry.first_byte + quarter * scan.geometry.stride;
        scan.bytes[first..first + scan.geometry.bins].fill(180);
        let raster = raster(&config, &scan, None);
        assert!(raster[25 * 51 + column] > 100.0);
        assert_eq!(raster[25 * 51 + 50 - column], 0.0);
        assert_eq!(centre_m(&config, 25, 5).y, 20.0);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]
    #[test]
    fn irregular_azimuths_are_used_as_measured(amplitude in 0.05..0.45f64, waves in 1.0..120.0f64, start in 0.0..TAU) {
        let mut sensor = Sensor::navtech();
        let count = sensor.azimuth_rad.len() as f64;
        for (i, azimuth) in sensor.azimuth_rad.iter_mut().enumerate() {
            let deviation = amplitude * (waves * i as f64).sin();
            *azimuth = (start + (i as f64 + deviation) / count * TAU).rem_euclid(TAU) as f32;
        }
        // Two azimuths can be 1.9 steps apart, 3 cells at 40 m: the largest miss of thousands of
        // cases was 0.132.
        check(&config(255, Sampling::Averaged), &sensor, 0.15);
    }
}
