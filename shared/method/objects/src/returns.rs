//! The returns of a scan in the frame of the odometry.

use gyre_geometry::{Pose, SparsePoint, Twist};
use nalgebra::{Point2, Vector2};

/// Range to either side of a return over which the power around it is averaged, m: more than a bus
/// is long.
const AROUND_M: f64 = 8.0;
/// Depth of a range cell, m.
const RANGE_CELL_M: f64 = 0.17;
/// Weight by which a return exceeds `contrast` times the mean around it to stand out.
const EXCESS: f64 = 0.1;

/// A scan with its pose and motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlacedScan {
    /// Time of the scan, the middle of the sweep, ns.
    pub stamp_ns: i64,
    /// The pose of the sensor at that time, in the frame of the odometry.
    pub pose: Pose,
    /// The velocity of the sensor during the sweep, by which the points are deskewed: that of the
    /// motion from the scan before, by [`Twist::from_chord`].
    pub twist: Twist,
}

/// A return, as if the sensor had stood and the object that reflects it too.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Return {
    /// Position in the frame of the odometry at the time of its azimuth, m.
    pub at: Point2<f64>,
    /// Unit vector from the sensor to it.
    pub direction: Vector2<f64>,
    /// Range, m.
    pub range_m: f64,
    /// Time of its azimuth relative to the scan's, s.
    pub time_s: f64,
    /// Metres by which a velocity of 1 m/s away from the sensor lengthens the measured range.
    pub doppler_s: f64,
    /// Weight from 0 to 1.
    pub weight: f64,
    /// True if it stands out of the returns of its azimuth around it.
    pub stands_out: bool,
    /// Share of the last scans with a return there: near 0 it is new, near 1 it stands.
    pub share: f64,
}

impl Return {
    /// Returns where it would be at the scan's time if it moves with a velocity, m.
    pub fn at_scan(&self, velocity: &Vector2<f64>) -> Point2<f64> {
        let away_mps = self.direction.dot(velocity);
        self.at - velocity * self.time_s - self.direction * (self.doppler_s * away_mps)
    }
}

/// Places the points of a scan up to a range, and marks those that exceed the mean around them in
/// their azimuth by a factor.
pub(crate) fn place(
    scan: &PlacedScan,
    points: &[SparsePoint],
    (max_range_m, contrast): (f64, f64),
    returns: &mut Vec<Return>,
) {
    returns.clear();
    for point in points.iter().filter(|point| point.weight > 0.0) {
        let there = point.deskewed(&scan.twist);
        let sensor = scan
            .twist
            .chord_pose_at(point.time_s.into())
            .translation
            .vector;
        let ray = there.coords - sensor;
        let range_m = ray.norm();
        if !(range_m > 0.0 && range_m <= max_range_m) {
            continue;
        }
        returns.push(Return {
            at: scan.pose * there,
            direction: scan.pose.rotation * (ray / range_m),
            range_m,
            time_s: point.time_s.into(),
            doppler_s: point.doppler_s.into(),
            weight: point.weight.into(),
            stands_out: false,
            share: 1.0,
        });
    }
    // All returns of an azimuth have the same time, and are in the order of their ranges.
    for azimuth in returns.chunk_by_mut(|a, b| a.time_s == b.time_s) {
        mark_what_stands_out(azimuth, contrast);
    }
}

/// Marks the returns of an azimuth that exceed the mean around them, as a cell-averaging detector
/// of constant false alarm rate does (Finn and Johnson 1968): behind a strong echo, its phase noise
/// and reverberation return from every range.
fn mark_what_stands_out(azimuth: &mut [Return], contrast: f64) {
    let (mut low, mut high, mut sum) = (0, 0, 0.0);
    for index in 0..azimuth.len() {
        let range_m = azimuth[index].range_m;
        while high < azimuth.len() && azimuth[high].range_m <= range_m + AROUND_M {
            sum += azimuth[high].weight;
            high += 1;
        }
        while azimuth[low].range_m < range_m - AROUND_M {
            sum -= azimuth[low].weight;
            low += 1;
        }
        let mean = sum / (2.0 * AROUND_M / RANGE_CELL_M);
        azimuth[index].stands_out = azimuth[index].weight > contrast * mean + EXCESS;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_echo_stands_out_of_an_empty_azimuth_and_reverberation_does_not() {
        let points = |weights: &dyn Fn(usize) -> f32| -> Vec<SparsePoint> {
            (0..120)
                .map(|cell| [10.0 + 0.17 * cell as f32, 0.0, 0.0, weights(cell), 0.0].into())
                .collect()
        };
        let scan = PlacedScan {
            stamp_ns: 0,
            pose: gyre_geometry::pose(0.0, 0.0, 0.0),
            twist: Twist::default(),
        };
        let marked = |points: &[SparsePoint]| {
            let mut returns = Vec::new();
            place(&scan, points, (70.0, 2.0), &mut returns);
            returns.iter().filter(|found| found.stands_out).count()
        };
        assert_eq!(
            marked(&points(&|cell| if cell / 3 == 20 { 0.5 } else { 0.0 })),
            3
        );
        assert_eq!(marked(&points(&|_| 0.5)), 0);
    }
}
