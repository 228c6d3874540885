//! Streets laid along a drive, with side streets.

use nalgebra::Point2;
use rand::Rng;

use super::lines::{Line, simplified};
use super::merge::{Waypoint, driven_lines, waypoints};
use super::network::Streets;
use super::side::side_lines;
use super::street::Street;
use crate::lanes::DrivingSide;
use crate::path::Path;
use crate::stream::Stream;

/// Minimum distance from the vehicle's centre to the kerb, metres.
const BESIDE_VEHICLE_M: f64 = 1.3;
/// Time between the poses for which that is checked, seconds.
const PASS_S: f64 = 0.05;
/// Maximum deviation of a street's line from the driven points, metres.
const TOLERANCE_M: f64 = 0.1;
/// Width of side streets, metres, from narrow residential ones to collectors.
const SIDE_WIDTH_M: std::ops::Range<f64> = 5.0..8.0;

impl Streets {
    /// Lays streets along the first `duration_s` of a drive, and side streets that branch off, the
    /// same for the same seed.
    ///
    /// The ego vehicle drives in its lane. What it drives twice, in either direction and with some
    /// metres of offset, is one street. Everywhere its centre is at least 1.3 m from the kerb.
    pub fn along(path: &dyn Path, duration_s: f64, driving_side: DrivingSide, seed: u64) -> Self {
        Self::along_all(&[(path, duration_s)], driving_side, seed)
    }

    /// As [`Streets::along`], along several drives, each with the duration of which streets are
    /// laid, seconds.
    pub fn along_all(drives: &[(&dyn Path, f64)], driving_side: DrivingSide, seed: u64) -> Self {
        let mut rng = Stream::Streets.generator(seed);
        let drives = drives
            .iter()
            .map(|(path, duration_s)| (*path, path.duration_s().min(*duration_s)));
        let waypoints: Vec<Vec<Waypoint>> = drives
            .clone()
            .map(|(path, duration_s)| waypoints(path, duration_s, driving_side))
            .collect();
        let lines = driven_lines(&waypoints);
        let speeds = mean_speeds(&lines, &waypoints);
        let sides = side_lines(&lines, &mut rng);
        let drawn = |line: &Line, half_width_m: f64, driven: bool| {
            let centre = simplified(line, TOLERANCE_M);
            Street {
                centre,
                half_width_m,
                driven,
            }
        };
        let mut streets = Vec::with_capacity(lines.len() + sides.len());
        for (line, speed_mps) in lines.iter().zip(speeds) {
            streets.push(drawn(line, driven_width_m(speed_mps, &mut rng) / 2.0, true));
        }
        for (path, duration_s) in drives {
            widen(&mut streets, path, duration_s);
        }
        for line in &sides {
            streets.push(drawn(line, rng.random_range(SIDE_WIDTH_M) / 2.0, false));
        }
        Self::new(streets)
    }
}

/// Width of a street by its mean speed: 6 m where slow, more than 10 m on main roads.
fn driven_width_m(speed_mps: f64, rng: &mut impl Rng) -> f64 {
    (3.5 + 0.65 * speed_mps).clamp(6.0, 11.0) + rng.random_range(0.0..2.5)
}

/// Mean speed along each line while the vehicle moves, metres a second.
fn mean_speeds(lines: &[Line], drives: &[Vec<Waypoint>]) -> Vec<f64> {
    let mut sums = vec![(0.0, 0.0); lines.len()];
    let carriageway = |line: &Line| Street {
        centre: line.clone(),
        half_width_m: 0.0,
        driven: true,
    };
    let network = Streets::new(lines.iter().map(carriageway).collect());
    for ends in drives.iter().flat_map(|waypoints| waypoints.windows(2)) {
        let speed_mps = (ends[1].vehicle - ends[0].vehicle).norm()
            / (ends[1].time_s - ends[0].time_s).max(1e-3);
        if let Some(nearest) = network.nearest(ends[0].centre, 12.0) {
            let (sum, count) = &mut sums[nearest.street];
            (*sum, *count) = (*sum + speed_mps, *count + 1.0);
        }
    }
    sums.into_iter()
        .map(|(sum, count)| if count > 0.0 { sum / count } else { 0.0 })
        .collect()
}

/// Widens the streets that are too narrow for the vehicle.
fn widen(streets: &mut [Street], path: &dyn Path, duration_s: f64) {
    let network = Streets::new(streets.to_vec());
    for step in 0..=(duration_s / PASS_S) as usize {
        let place = Point2::from(path.pose(step as f64 * PASS_S).translation.vector);
        if let Some(nearest) = network.nearest(place, 20.0) {
            let street = &mut streets[nearest.street];
            street.half_width_m = street.half_width_m.max(nearest.offset_m + BESIDE_VEHICLE_M);
        }
    }
}
