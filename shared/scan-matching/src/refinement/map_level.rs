//! One level of the local map: the keyframes' images on the grid of the map, and their sum.
//!
//! A keyframe is drawn once, from its own points at its own pose, and never resampled: repeated resampling blurs the map
//! along the path, and a blurred map pulls the next scan with it.

use gyre_geometry::Pose;
use gyre_simd::simd;
use nalgebra::Point2;
use ndarray::{ArrayView2, ArrayViewMut2};

use super::points::DeskewedPoints;

/// Weights of a Gaussian blur with a standard deviation of one cell, at distances of 0 to 3 cells.
const BLUR: [f32; 4] = [0.399_050_3, 0.242_036_2, 0.054_005_58, 0.004_433_048];
const BLUR_REACH: usize = 3;
/// The value of a fully occupied cell.
pub(super) const FULL: f32 = 255.0;

/// The image of one keyframe, on a square of the map's grid: 0 for an empty cell, up to 255.
#[derive(Debug, Clone)]
pub(super) struct Image {
    /// The map's cell (x, y) that the first value belongs to.
    pub corner: [i64; 2],
    /// Cells a side.
    n: usize,
    /// Row after row. Rows are of equal x, which grows with the row; y grows within a row.
    pub cells: Vec<u8>,
}

impl Image {
    pub fn view(&self) -> ArrayView2<'_, u8> {
        ArrayView2::from_shape((self.n, self.n), &self.cells).expect(SQUARE)
    }

    /// The corner and the cells, to be filled in.
    pub fn parts_mut(&mut self) -> (&mut [i64; 2], ArrayViewMut2<'_, u8>) {
        let cells = ArrayViewMut2::from_shape((self.n, self.n), &mut self.cells);
        (&mut self.corner, cells.expect(SQUARE))
    }
}

const SQUARE: &str = "an image has n x n cells";

/// The sum of the keyframes' images.
#[derive(Debug)]
pub(super) struct MapLevel {
    /// Metres a cell.
    pub cell_m: f64,
    /// Cells a side.
    pub n: usize,
    corner: [i64; 2],
    /// Sum of the images.
    sum: Vec<u16>,
    images: usize,
    drawing: Vec<f32>,
    blurred: Vec<f32>,
}

/// A level as alignments read it.
pub(super) struct MapView<'a> {
    /// Sums of the images, row after row; divided by `full` they are shares from 0 to 1.
    pub sum: &'a [u16],
    pub n: usize,
    /// The sum in a cell that is fully occupied in all keyframes.
    pub full: f32,
    /// Cells a metre.
    pub per_m: f32,
    /// Map coordinates (x, y) of cell (0, 0), m.
    pub origin: [f64; 2],
}

impl MapLevel {
    pub fn new(cell_m: f64, reach_m: f64) -> Self {
        let n = 2 * (reach_m / cell_m).ceil() as usize + 1;
        let cells = || vec![0.0; n * n];
        Self {
            cell_m,
            n,
            corner: [0; 2],
            sum: vec![0; n * n],
            images: 0,
            drawing: cells(),
            blurred: cells(),
        }
    }

    pub fn new_image(&self) -> Image {
        Image {
            corner: [0; 2],
            n: self.n,
            cells: vec![0; self.n * self.n],
        }
    }

    /// Draws a keyframe: splats, blurs, and saturates.
    ///
    /// The saturation m / (m + mean) bounds the weight of a cell: without it bright clutter, and what moves with the
    /// vehicle, outweighs the many faint returns that determine the motion.
    pub fn draw(&mut self, points: &DeskewedPoints, pose: &Pose, image: &mut Image) {
        let half = (self.n / 2) as i64;
        image.corner = [pose.translation.x, pose.translation.y]
            .map(|v| (v / self.cell_m).floor() as i64 - half);
        self.splat(points, pose, image.corner);
        blur(&self.drawing, &mut self.blurred, 1);
        blur(&self.blurred, &mut self.drawing, self.n);
        let (sum, squares) = moments(&self.drawing);
        let mean = if sum > 0.0 { squares / sum } else { 1.0 };
        saturate(&self.drawing, mean as f32, &mut image.cells);
    }

    fn splat(&mut self, points: &DeskewedPoints, pose: &Pose, corner: [i64; 2]) {
        self.drawing.fill(0.0);
        let (n, per_m) = (self.n, 1.0 / self.cell_m);
        let inside = BLUR_REACH as f64..(n - BLUR_REACH - 2) as f64;
        for ((&x, &y), &weight) in points.x_m.iter().zip(&points.y_m).zip(&points.weight) {
            let at = pose * Point2::new(f64::from(x), f64::from(y));
            let (u, v) = (
                at.x * per_m - corner[0] as f64,
                at.y * per_m - corner[1] as f64,
            );
            if !(inside.contains(&u) && inside.contains(&v)) {
                continue;
            }
            let (i, j) = (u as usize, v as usize);
            let (across, along) = ((u - i as f64) as f32, (v - j as f64) as f32);
            let first = i * n + j;
            self.drawing[first] += weight * (1.0 - across) * (1.0 - along);
            self.drawing[first + 1] += weight * (1.0 - across) * along;
            self.drawing[first + n] += weight * across * (1.0 - along);
            self.drawing[first + n + 1] += weight * across * along;
        }
    }

    /// Sums these images on the square of the last one. The sums are of integers, so exact in any order.
    pub fn sum_images<'a>(&mut self, images: impl Iterator<Item = &'a Image> + Clone) {
        self.sum.fill(0);
        self.images = 0;
        let Some(newest) = images.clone().last() else {
            return;
        };
        self.corner = newest.corner;
        for image in images {
            self.images += 1;
            let [down, right] = [
                image.corner[0] - self.corner[0],
                image.corner[1] - self.corner[1],
            ];
            let n = self.n as i64;
            let (first_col, last_col) = (right.max(0), (right + n).min(n));
            if first_col >= last_col {
                continue;
            }
            for row in down.max(0)..(down + n).min(n) {
                let to = (row * n + first_col) as usize..(row * n + last_col) as usize;
                let from = ((row - down) * n + first_col - right) as usize;
                let from = &image.cells[from..from + to.len()];
                add(from, &mut self.sum[to]);
            }
        }
    }

    pub fn view(&self) -> MapView<'_> {
        MapView {
            sum: &self.sum,
            n: self.n,
            full: FULL * self.images.max(1) as f32,
            per_m: (1.0 / self.cell_m) as f32,
            origin: self.corner.map(|cell| cell as f64 * self.cell_m),
        }
    }
}

/// One pass of the blur along an axis. Cells within the blur's reach of the array's ends stay zero; the caller draws
/// nothing there.
#[simd]
fn blur(from: &[f32], to: &mut [f32], stride: usize) {
    let margin = BLUR_REACH * stride;
    let count = from.len() - 2 * margin;
    let at = |steps: usize| &from[steps * stride..][..count];
    let (a, b, c, d, e, f, g) = (at(0), at(1), at(2), at(3), at(4), at(5), at(6));
    let inner = &mut to[margin..][..count];
    for k in 0..count {
        inner[k] = BLUR[0] * d[k]
            + BLUR[1] * (c[k] + e[k])
            + BLUR[2] * (b[k] + f[k])
            + BLUR[3] * (a[k] + g[k]);
    }
}

/// Sum and sum of squares, in lanes.
#[simd]
fn moments(values: &[f32]) -> (f64, f64) {
    let (chunks, rest) = values.as_chunks::<16>();
    let (mut sums, mut squares) = ([0.0_f32; 16], [0.0_f32; 16]);
    for chunk in chunks {
        for lane in 0..16 {
            sums[lane] += chunk[lane];
            squares[lane] += chunk[lane] * chunk[lane];
        }
    }
    let total = |lanes: [f32; 16], rest: f32| {
        lanes.iter().map(|v| f64::from(*v)).sum::<f64>() + f64::from(rest)
    };
    (
        total(sums, rest.iter().sum()),
        total(squares, rest.iter().map(|v| v * v).sum()),
    )
}

/// Saturates the cells. Most are empty, so they are skipped sixteen at a time.
#[simd]
fn saturate(values: &[f32], mean: f32, cells: &mut [u8]) {
    for (cells, values) in cells.chunks_mut(16).zip(values.chunks(16)) {
        if values.iter().all(|value| *value == 0.0) {
            cells.fill(0);
            continue;
        }
        for (cell, value) in cells.iter_mut().zip(values) {
            // By way of i32: the direct conversion is not vectorised.
            *cell = (FULL * value / (value + mean) + 0.5) as i32 as u8;
        }
    }
}

/// Adds an image to the sum. At most 64 images of at most 255 do not overflow.
#[simd]
fn add(cells: &[u8], sum: &mut [u16]) {
    sum.iter_mut()
        .zip(cells)
        .for_each(|(sum, cell)| *sum += u16::from(*cell));
}

#[cfg(test)]
mod tests {
    use gyre_geometry::pose;

    use super::*;

    fn points(places: &[[f32; 2]]) -> DeskewedPoints {
        DeskewedPoints {
            x_m: places.iter().map(|p| p[0]).collect(),
            y_m: places.iter().map(|p| p[1]).collect(),
            weight: vec![1.0; places.len()],
        }
    }

    fn brightest(level: &MapLevel) -> [f64; 2] {
        let view = level.view();
        let brightest = (0..view.sum.len())
            .max_by_key(|k| (view.sum[*k], std::cmp::Reverse(*k)))
            .unwrap_or(0);
        [brightest / level.n, brightest % level.n]
            .map(|k| k as f64 * level.cell_m)
            .into_iter()
            .zip(view.origin)
            .map(|(at, origin)| at + origin)
            .collect::<Vec<_>>()
            .try_into()
            .unwrap_or([f64::NAN; 2])
    }

    #[test]
    fn one_place_seen_from_two_poses_falls_into_one_cell() {
        let mut level = MapLevel::new(0.5, 20.0);
        let (mut first, mut second) = (level.new_image(), level.new_image());
        level.draw(&points(&[[6.0, 2.0]]), &Pose::identity(), &mut first);
        let pose = pose(3.0, 1.0, std::f64::consts::FRAC_PI_2);
        let seen = pose.inverse() * Point2::new(6.0, 2.0);
        level.draw(
            &points(&[[seen.x as f32, seen.y as f32]]),
            &pose,
            &mut second,
        );
        level.sum_images([&first, &second].into_iter());
        assert_eq!(brightest(&level), [6.0, 2.0]);
        let peak = f32::from(level.view().sum.iter().copied().max().unwrap_or(0));
        assert!(
            (peak / level.view().full - 2.0 / 3.0).abs() < 0.01,
            "{peak}: m / (m + mean), a Gaussian's mean being half its peak"
        );
    }

    #[test]
    fn a_blur_keeps_the_sum() {
        let mut level = MapLevel::new(1.0, 20.0);
        let mut image = level.new_image();
        level.draw(
            &points(&[[0.3, 0.4], [7.7, -8.2]]),
            &Pose::identity(),
            &mut image,
        );
        let (sum, _) = moments(&level.drawing);
        assert!((sum - 2.0).abs() < 1e-5, "{sum}");
    }

    #[test]
    fn points_out_of_reach_are_ignored() {
        let mut level = MapLevel::new(1.0, 20.0);
        let mut image = level.new_image();
        level.draw(
            &points(&[[25.0, 0.0], [f32::NAN, 0.0], [0.0, -1e30]]),
            &Pose::identity(),
            &mut image,
        );
        assert!(image.cells.iter().all(|cell| *cell == 0));
        level.sum_images([&image].into_iter());
        assert!(level.view().sum.iter().all(|sum| *sum == 0));
    }
}
