use std::f64::consts::TAU;
use std::path::Path;

use gyre_geometry::{Pose, SparsePoint};
use gyre_masking::networks::{PlanesError, PlanesNetwork};
use nalgebra::{Matrix2, Point2, Vector2};

use crate::PlacedScan;
use crate::raster::{Memory, PLANES, SIDE};

const NETWORK: &str = "gyre:models/objects.onnx";
/// Cells of the output, a side: each is as large as two by two of the input.
const OUT: usize = SIDE / 2;
const VALUES: usize = 11;
/// Side of a cell of the output, m.
const OUT_M: f64 = 2.0 * crate::raster::CELL_M;
const SPEED_MPS: f64 = 8.0;
/// Length and width whose ratios it gives, m.
const SIZE_M: [f64; 2] = [4.5, 1.9];
/// Distance within which only the most likely detection counts, m.
const ALONE_M: f64 = 2.5;

pub(crate) struct Detector {
    network: PlanesNetwork,
    memory: Memory,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Detection {
    /// The centre in the frame of the odometry at the time of its azimuth, with the Doppler shift
    /// of its motion, m.
    pub at: Point2<f64>,
    pub velocity: Vector2<f64>,
    pub heading: Vector2<f64>,
    /// Length and width, m.
    pub size_m: [f64; 2],
    /// The likelihood that a vehicle which moves is there, 0 to 1.
    pub likely: f64,
    pub sigma_m: f64,
    pub sigma_mps: f64,
    /// The change of `at` by the velocity, s: it is seen at its own time, and lengthened or
    /// shortened by the Doppler shift.
    pub by_velocity: Matrix2<f64>,
}

impl Detector {
    pub fn new(runtime: Option<&Path>) -> Result<Self, PlanesError> {
        // The network gives each plane in four, of every other row and column.
        let shapes = [[PLANES, SIDE, SIDE], [4 * VALUES, OUT / 2, OUT / 2]];
        Ok(Self {
            network: PlanesNetwork::load(NETWORK, runtime, shapes)?,
            memory: Memory::new(),
        })
    }

    pub fn clear(&mut self) {
        self.memory.clear();
    }

    /// Finds the vehicles of the next scan that are likelier than `least`, the likeliest first.
    pub fn detect(
        &mut self,
        scan: &PlacedScan,
        points: &[SparsePoint],
        least: f64,
    ) -> Result<Vec<Detection>, PlanesError> {
        let deskewed = points.iter().map(|point| point.deskewed(&scan.twist));
        let deskewed: Vec<Point2<f64>> = deskewed.collect();
        self.memory.add(scan, points, &deskewed);
        let output = Output(self.network.compute(self.memory.draw(&scan.pose))?);
        let mut found: Vec<Detection> = Vec::new();
        for cell in output.peaks(least) {
            let detection = output.read(cell);
            let is_far = |other: &Detection| (other.at - detection.at).norm() > ALONE_M;
            if found.iter().all(is_far) {
                found.push(detection);
            }
        }
        for detection in &mut found {
            detection.place(&scan.pose, points, &deskewed);
        }
        Ok(found)
    }
}

/// The network's output: each plane in four, of every other row and column.
struct Output(Vec<f32>);

impl Output {
    fn value(&self, plane: usize, [row, column]: [usize; 2]) -> f32 {
        const HALF: usize = OUT / 2;
        let part = 4 * plane + 2 * (row % 2) + column % 2;
        self.0[(part * HALF + row / 2) * HALF + column / 2]
    }

    /// Returns the cells that are at least as likely as those around them, the likeliest first.
    fn peaks(&self, least: f64) -> Vec<[usize; 2]> {
        let least = (least / (1.0 - least)).ln() as f32;
        let around = |at: usize| at.saturating_sub(1)..=(at + 1).min(OUT - 1);
        let is_peak = |[row, column]: &[usize; 2]| {
            let value = self.value(0, [*row, *column]);
            let mut near = around(*row).flat_map(|row| around(*column).map(move |at| [row, at]));
            value > least && near.all(|cell| self.value(0, cell) <= value)
        };
        let cells = (0..OUT * OUT).map(|cell| [cell / OUT, cell % OUT]);
        let mut found: Vec<[usize; 2]> = cells.filter(is_peak).collect();
        found.sort_by(|a, b| self.value(0, *b).total_cmp(&self.value(0, *a)));
        found
    }

    fn read(&self, cell: [usize; 2]) -> Detection {
        let value = |plane: usize| f64::from(self.value(plane, cell));
        let centre = cell.map(|at| (at as f64 + 0.5 - (OUT / 2) as f64) * OUT_M);
        let heading = Vector2::new(value(5), value(6));
        Detection {
            at: Point2::new(centre[0] + value(1), centre[1] + value(2)),
            velocity: Vector2::new(value(3), value(4)) * SPEED_MPS,
            heading: heading.try_normalize(1e-6).unwrap_or_else(Vector2::x),
            size_m: [
                SIZE_M[0] * value(7).clamp(-2.0, 2.0).exp(),
                SIZE_M[1] * value(8).clamp(-2.0, 2.0).exp(),
            ],
            likely: 1.0 / (1.0 + (-value(0)).exp()),
            sigma_m: value(9).clamp(-3.0, 2.0).exp(),
            sigma_mps: value(10).clamp(-3.0, 3.0).exp(),
            by_velocity: Matrix2::zeros(),
        }
    }
}

impl Detection {
    /// Returns the covariance of `at`, m².
    pub fn noise(&self) -> Matrix2<f64> {
        Matrix2::identity() * self.sigma_m.powi(2)
    }

    /// Transforms it from the frame of the sensor to the odometry frame, at the time of the azimuth
    /// that shows it.
    fn place(&mut self, pose: &Pose, points: &[SparsePoint], deskewed: &[Point2<f64>]) {
        let here_rad = bearing_rad(&self.at);
        let apart_rad = |from_sensor: &Point2<f64>| {
            let apart_rad = (bearing_rad(from_sensor) - here_rad).abs();
            apart_rad.min(TAU - apart_rad)
        };
        let apart = deskewed.iter().map(apart_rad).zip(points);
        let shown_by = apart.min_by(|a, b| a.0.total_cmp(&b.0));
        let (time_s, doppler_s) = shown_by.map_or((0.0, 0.0), |(_, point)| {
            (f64::from(point.time_s), f64::from(point.doppler_s))
        });
        let away = pose.rotation * self.at.coords.try_normalize(1e-9).unwrap_or_default();
        self.at = pose * self.at;
        self.velocity = pose.rotation * self.velocity;
        self.heading = pose.rotation * self.heading;
        self.by_velocity = Matrix2::identity() * time_s + away * away.transpose() * doppler_s;
    }
}

fn bearing_rad(at: &Point2<f64>) -> f64 {
    at.y.atan2(at.x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gyre_geometry::{Twist, pose};
    use std::f64::consts::FRAC_PI_2;

    fn output(values: [f32; VALUES]) -> Output {
        let cells = values.map(|value| vec![value; OUT * OUT]);
        Output(cells.concat())
    }

    impl Output {
        fn set(&mut self, plane: usize, [row, column]: [usize; 2], value: f32) {
            // Parts of 64 x 64 cells each.
            let part = [[0, 1], [2, 3]][row % 2][column % 2];
            self.0[((4 * plane + part) * 64 + row / 2) * 64 + column / 2] = value;
        }
    }

    #[test]
    fn a_detection_is_the_likeliest_cell_of_its_surroundings_and_has_its_values() {
        let mut output = output([-9.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let (cell, far) = ([80, 71], [81, 76]);
        let values = [2.0, 0.25, -0.5, 1.0, -0.5, 0.0, 2.0, 0.0, 0.0, 0.0, -9.0];
        for (plane, value) in values.into_iter().enumerate() {
            output.set(plane, cell, value);
        }
        output.set(0, [80, 72], 1.0);
        output.set(0, far, 0.0);
        assert_eq!(output.peaks(0.3), [cell, far]);
        assert_eq!(output.peaks(0.6), [cell]);
        let found = output.read(cell);
        assert_eq!(found.at, Point2::new(16.75, 7.0));
        assert_eq!(found.velocity, Vector2::new(8.0, -4.0));
        assert_eq!(found.heading, Vector2::y());
        assert_eq!((found.size_m, found.sigma_m), (SIZE_M, 1.0));
        assert!((found.likely - 0.881).abs() < 1e-3);
        // The output is clamped to the range of the training.
        assert!((found.sigma_mps - (-3f64).exp()).abs() < 1e-12);
    }

    #[test]
    fn a_detection_has_the_time_and_the_doppler_factor_of_the_azimuth_that_shows_it() {
        let scan = PlacedScan {
            stamp_ns: 0,
            pose: pose(100.0, 0.0, FRAC_PI_2),
            twist: Twist::default(),
        };
        let ahead = SparsePoint::from([20.0, 0.0, -0.1, 1.0, 0.05]);
        let aside = SparsePoint::from([0.0, 20.0, 0.07, 1.0, 0.05]);
        let output = output([0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        // At 30.5 m to the left.
        let mut found = output.read([OUT / 2, OUT / 2 + 30]);
        let deskewed = [ahead, aside].map(|point| point.deskewed(&scan.twist));
        found.place(&scan.pose, &[ahead, aside], &deskewed);
        assert!(
            (found.at - Point2::new(69.5, 0.5)).norm() < 1e-9,
            "{found:?}"
        );
        assert!((found.heading - Vector2::y()).norm() < 1e-9);
        // Seen along the world's -x.
        let wanted = Matrix2::new(0.12, 0.0, 0.0, 0.07);
        assert!((found.by_velocity - wanted).norm() < 2e-3, "{found:?}");
    }
}
