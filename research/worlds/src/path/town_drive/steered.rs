//! A lane as a vehicle drives it, with gradual steering.

use nalgebra::Point2;

use super::lane::Lane;
use crate::path::spline::{Sample, UniformSpline};

/// Cut-off wavelength of the smoothing, metres: vehicles steer over this distance.
const STEER_M: f64 = 9.0;

/// A smoothed lane.
pub struct SteeredLane {
    /// Places by distance along the lane, metres.
    pub curve: UniformSpline<2>,
    pub length_m: f64,
}

/// Smooths a lane.
pub fn steered(lane: &Lane) -> SteeredLane {
    let mut length_m = 0.0;
    let mut before: Option<Point2<f64>> = None;
    let sample = |place: &Point2<f64>| {
        length_m += before.map_or(0.0, |before| (place - before).norm());
        before = Some(*place);
        Sample {
            at: length_m,
            value: [place.x, place.y],
            weight: 1.0,
        }
    };
    let samples: Vec<_> = lane.places.iter().map(sample).collect();
    SteeredLane {
        curve: UniformSpline::fit(&samples, 1.0, 1.0 / STEER_M),
        length_m,
    }
}
