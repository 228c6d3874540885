//! The returns of a scan in the frame of the odometry.

use gyre_geometry::{Pose, SparsePoint, Twist, wrap_angle};
use nalgebra::{Matrix2, Point2, Vector2};

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

/// The steps in which a scan measures, from its points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Resolution {
    /// Depth of a range cell, m.
    pub range_m: f64,
    /// Angle between two azimuths, rad.
    pub azimuth_rad: f64,
}

/// That of most radars that turn four times a second, before a scan is seen.
impl Default for Resolution {
    fn default() -> Self {
        Self {
            range_m: RANGE_CELL_M,
            azimuth_rad: 0.9f64.to_radians(),
        }
    }
}

impl Resolution {
    /// Measures the smallest steps between the points of a scan, which are in the order of their
    /// azimuths, and in each of their ranges; `None` where there are none to measure.
    pub fn of(points: &[SparsePoint]) -> Option<Self> {
        let azimuths: Vec<&[SparsePoint]> = points.chunk_by(|a, b| a.time_s == b.time_s).collect();
        let range_m = |point: &SparsePoint| f64::from(point.x_m).hypot(point.y_m.into());
        let along = azimuths.iter().flat_map(|azimuth| azimuth.windows(2));
        let ranges_m = along.map(|pair| (range_m(&pair[1]) - range_m(&pair[0])).abs());
        let angle_rad =
            |points: &[SparsePoint]| f64::from(points[0].y_m).atan2(points[0].x_m.into());
        let steps = azimuths.windows(2);
        let steps_rad = steps.map(|pair| wrap_angle(angle_rad(pair[1]) - angle_rad(pair[0])).abs());
        Some(Self {
            range_m: least(ranges_m)?,
            azimuth_rad: least(steps_rad)?,
        })
    }

    /// Standard deviation of the bearing of a return, rad: which azimuth of the beam, two of them
    /// wide, is the strongest is random.
    pub fn bearing_sigma_rad(&self) -> f64 {
        2.0 * self.azimuth_rad / 12f64.sqrt()
    }

    /// Returns the covariance of the place of a return, m², if the edge that reflects is that of
    /// the body but for a standard deviation, m.
    pub fn noise(&self, direction: &Vector2<f64>, range_m: f64, edge_m: f64) -> Matrix2<f64> {
        let across = Vector2::new(-direction.y, direction.x);
        let bearing_m2 = (self.bearing_sigma_rad() * range_m).powi(2);
        direction * direction.transpose() * (self.range_m.powi(2) / 12.0)
            + across * across.transpose() * bearing_m2
            + Matrix2::identity() * edge_m.powi(2)
    }
}

/// Returns the smallest of some steps that are more than rounding.
fn least(steps: impl Iterator<Item = f64>) -> Option<f64> {
    steps.filter(|step| *step > 1e-3).min_by(f64::total_cmp)
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
    fn the_resolution_is_the_smallest_step_between_points() {
        let at = |azimuth: i32, cell: i32| {
            let angle = 0.0157 * f64::from(azimuth);
            let range_m = 10.0 + 0.175 * f64::from(cell);
            SparsePoint {
                x_m: (range_m * angle.cos()) as f32,
                y_m: (-range_m * angle.sin()) as f32,
                time_s: azimuth as f32 * 1e-3,
                weight: 1.0,
                doppler_s: 0.0,
            }
        };
        let points = [at(0, 0), at(0, 4), at(0, 5), at(2, 1), at(3, 9), at(399, 9)];
        let found = Resolution::of(&points).unwrap_or(Resolution {
            range_m: 0.0,
            azimuth_rad: 0.0,
        });
        assert!((found.range_m - 0.175).abs() < 1e-4, "{found:?}");
        assert!((found.azimuth_rad - 0.0157).abs() < 1e-4, "{found:?}");
        assert_eq!(Resolution::of(&points[..1]), None);
    }

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
