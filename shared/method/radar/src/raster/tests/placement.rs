//! Scatterers appear in the raster at their true positions.

use super::scene::{Sensor, centre_m, miss_cells, raster};
use crate::raster::RasterConfig;
use gyre_geometry::scan::Sense;
use nalgebra::Point2;

const SIGMA_M: f64 = 1.0;

#[test]
fn scatterers_are_placed_at_every_size() {
    // Ahead (between the last and the first azimuth), left, right, behind, near and far.
    let places = [
        (30.0, 0.3),
        (8.0, -6.0),
        (-20.0, 15.0),
        (-35.0, -0.2),
        (0.4, 40.0),
        (3.0, -44.0),
        (38.0, 33.0),
    ]
    .map(|(x, y)| Point2::new(x, y));
    let scan = Sensor::navtech().measure(&places, SIGMA_M);
    for n in [127, 128, 254, 255, 256, 511] {
        let config = RasterConfig::of(n, 102.0 / n as f32);
        let raster = raster(&config, &scan, None);
        for place in &places {
            let miss = miss_cells(&config, &raster, place, 4.0 * SIGMA_M);
            assert!(miss < 0.06, "{n}: {place} is off by {miss} cells");
        }
    }
}

#[test]
fn a_row_to_the_right_is_drawn_to_the_right() {
    let config = RasterConfig::of(51, 1.0);
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
