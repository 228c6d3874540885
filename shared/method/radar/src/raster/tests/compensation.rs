//! Motion compensation: the raster of a moving sensor shows the scene at the middle of the sweep.

use gyre_geometry::{Twist, scan::Sense};
use nalgebra::Point2;
use proptest::prelude::*;

use super::scene::{Sensor, miss_cells, raster};
use crate::raster::{RasterConfig, Sampling};

const SIGMA_M: f64 = 1.0;

fn polar(range_m: f64, bearing_rad: f64) -> Point2<f64> {
    Point2::new(range_m * bearing_rad.cos(), range_m * bearing_rad.sin())
}

/// Scatterers in all directions except straight ahead, where a moving sensor may see them twice or
/// not at all.
fn places() -> Vec<Point2<f64>> {
    let ranges = [25.0, 60.0, 12.0, 80.0, 40.0, 70.0, 18.0];
    let bearings = (1..8).map(|k| f64::from(k) * std::f64::consts::FRAC_PI_4);
    ranges
        .into_iter()
        .zip(bearings)
        .map(|(range, bearing)| polar(range, bearing))
        .collect()
}

fn worst_miss(config: &RasterConfig, sensor: &Sensor, twist: Option<Twist>) -> f64 {
    let places = places();
    let raster = raster(config, &sensor.measure(&places, SIGMA_M), twist);
    let misses = places
        .iter()
        .map(|place| miss_cells(config, &raster, place, 4.0 * SIGMA_M));
    misses.fold(0.0, f64::max)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]
    #[test]
    fn any_motion_of_a_vehicle_is_compensated(
        vx in -20.0..30.0f64, vy in -3.0..3.0f64, yaw_rate in -1.0..1.0f64, clockwise: bool,
    ) {
        // Tyres allow a lateral acceleration of some 8 m/s^2.
        let yaw_rate_radps = yaw_rate * (8.0 / vx.abs()).min(1.0);
        let twist = Twist::from([vx, vy, yaw_rate_radps]);
        let sense = if clockwise { Sense::Clockwise } else { Sense::CounterClockwise };
        let sensor = Sensor { twist, sense, ..Sensor::navtech() };
        let miss = worst_miss(&RasterConfig::default(), &sensor, Some(twist));
        prop_assert!(miss < 0.05, "{miss}");
    }
}

#[test]
fn doppler_shifts_are_compensated_chirp_by_chirp() {
    let twist = Twist::from([20.0, 0.5, 0.3]);
    for (sense, chirps_alternate, doppler_s) in [
        (Sense::Clockwise, false, 0.042),
        (Sense::CounterClockwise, false, -0.042),
        (Sense::Clockwise, true, 0.049),
    ] {
        let sensor = Sensor {
            twist,
            sense,
            doppler_s,
            chirps_alternate,
            ..Sensor::navtech()
        };
        for config in [
            RasterConfig::default(),
            RasterConfig::of(511, 0.4),
            RasterConfig {
                sampling: Sampling::Bilinear,
                ..RasterConfig::default()
            },
        ] {
            let miss = worst_miss(&config, &sensor, Some(twist));
            assert!(
                miss < 0.05,
                "{sense:?} {chirps_alternate} {config:?}: {miss}"
            );
        }
    }
}

#[test]
fn stamps_in_bursts_are_used_as_they_are() {
    let twist = Twist::from([20.0, 0.0, 0.3]);
    let mut sensor = Sensor {
        twist,
        ..Sensor::navtech()
    };
    for (azimuth, time_s) in sensor.time_s.iter_mut().enumerate() {
        *time_s = 0.25 * ((azimuth / 8 * 8) as f64 / 400.0 - 0.5) + 1e-5 * (azimuth % 8) as f64;
    }
    let miss = worst_miss(&RasterConfig::default(), &sensor, Some(twist));
    assert!(miss < 0.1, "{miss}");
}
