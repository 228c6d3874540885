//! One level of the local map: the keyframes' images on the grid of the map, and their sum.
//!
//! A keyframe is drawn once, from its own points at its own pose, and never resampled: repeated
//! resampling blurs the map along the path, and a blurred map pulls the next scan with it.

use gyre_geometry::Pose;
use gyre_simd::simd;
use nalgebra::{Point2, Vector2};
use ndarray::{ArrayView2, ArrayViewMut2};

use super::points::DeskewedPoints;

/// Weights of a Gaussian blur with a standard deviation of one cell, at distances of 0 to 3 cells.
const BLUR: [f32; 4] = [0.399_050_3, 0.242_036_2, 0.054_005_58, 0.004_433_048];
const BLUR_REACH: usize = 3;
/// Cells along an axis over which a point is spread: it is between two cells, which are both
/// blurred.
const SPREAD: usize = 2 * BLUR_REACH + 2;
const CHUNK: usize = 16;
// A row of a point's cells lies within two chunks.
const _: () = assert!(SPREAD <= CHUNK + 1);
/// The farthest cell from the origin: a damaged checkpoint may contain any number.
const FARTHEST: f64 = 1e15;
pub(super) const FULL: f32 = 255.0;

const SQUARE: &str = "an image has n x n cells";

/// The image of one keyframe, on a square of the map's grid: 0 for an empty cell, up to 255.
#[derive(Debug, Clone)]
pub(super) struct Image {
    /// The map's cell (x, y) that the first value belongs to.
    pub corner: [i64; 2],
    n: usize,
    cell_m: f64,
    /// Row after row. Rows are of equal x, which grows with the row; y grows within a row.
    pub cells: Vec<u8>,
}

impl Image {
    pub fn view(&self) -> ArrayView2<'_, u8> {
        ArrayView2::from_shape((self.n, self.n), &self.cells).expect(SQUARE)
    }

    pub fn parts_mut(&mut self) -> (&mut [i64; 2], ArrayViewMut2<'_, u8>) {
        let cells = ArrayViewMut2::from_shape((self.n, self.n), &mut self.cells);
        (&mut self.corner, cells.expect(SQUARE))
    }

    /// The slope at a place in the map, per metre, of an image from 0 to 1, between whose cells it
    /// is interpolated linearly: zero outside the image.
    pub fn slope(&self, place: Vector2<f64>) -> Vector2<f64> {
        let n = self.n;
        let at = |axis: usize| place[axis] / self.cell_m - self.corner[axis] as f64;
        let (u, v) = (at(0), at(1));
        let last = (n - 1) as f64;
        if !((0.0..last).contains(&u) && (0.0..last).contains(&v)) {
            return Vector2::zeros();
        }
        let (across, along) = (u.fract(), v.fract());
        let first = u as usize * n + v as usize;
        let [a, b, c, d] =
            [first, first + 1, first + n, first + n + 1].map(|cell| f64::from(self.cells[cell]));
        let per_m = 1.0 / (self.cell_m * f64::from(FULL));
        let (upper, lower) = (a + along * (b - a), c + along * (d - c));
        let (left, right) = (a + across * (c - a), b + across * (d - b));
        Vector2::new(lower - upper, right - left) * per_m
    }
}

#[derive(Debug)]
pub(super) struct MapLevel {
    pub cell_m: f64,
    pub n: usize,
    corner: [i64; 2],
    sum: Vec<u16>,
    images: usize,
    /// A keyframe before it is saturated; all zero between calls of `draw`. Whole chunks: a few
    /// cells more than n x n.
    drawing: Vec<f32>,
    drawn: Vec<bool>,
}

pub(super) struct MapView<'a> {
    /// Sums of the images, row after row; divided by `full` they are shares from 0 to 1.
    pub sum: &'a [u16],
    pub n: usize,
    /// The sum in a cell that is fully occupied in all keyframes.
    pub full: f32,
    pub per_m: f32,
    /// Map coordinates (x, y) of cell (0, 0), m.
    pub origin: [f64; 2],
}

impl MapLevel {
    pub fn new(cell_m: f64, reach_m: f64) -> Self {
        let n = 2 * (reach_m / cell_m).ceil() as usize + 1;
        let chunks = (n * n).div_ceil(CHUNK);
        Self {
            cell_m,
            n,
            corner: [0; 2],
            sum: vec![0; n * n],
            images: 0,
            drawing: vec![0.0; chunks * CHUNK],
            drawn: vec![false; chunks],
        }
    }

    pub fn new_image(&self) -> Image {
        Image {
            corner: [0; 2],
            n: self.n,
            cell_m: self.cell_m,
            cells: vec![0; self.n * self.n],
        }
    }

    /// Draws a keyframe: spreads its points, and saturates.
    ///
    /// The saturation m / (m + mean) bounds the weight of a cell: without it bright clutter, and
    /// what moves with the vehicle, outweighs the many faint returns that determine the motion.
    pub fn draw(&mut self, points: &DeskewedPoints, pose: &Pose, image: &mut Image) {
        let half = (self.n / 2) as i64;
        image.corner = [pose.translation.x, pose.translation.y]
            .map(|v| (v / self.cell_m).floor().clamp(-FARTHEST, FARTHEST) as i64 - half);
        let place = Drawing {
            pose: *pose,
            corner: image.corner,
            per_m: 1.0 / self.cell_m,
            n: self.n,
        };
        spread(points, &place, &mut self.drawing, &mut self.drawn);
        let mean = mean(&self.drawing, &self.drawn);
        saturate(&mut self.drawing, &mut self.drawn, mean, &mut image.cells);
    }

    /// Sums these images on the square of the last one. The sums are of integers, so exact in any
    /// order.
    pub fn sum_images<'a>(&mut self, images: impl Iterator<Item = &'a Image> + Clone) {
        self.sum.fill(0);
        self.images = 0;
        let Some(newest) = images.clone().last() else {
            return;
        };
        self.corner = newest.corner;
        for image in images {
            self.images += 1;
            self.combine(image, [[0, 0], [self.n, self.n]], add);
        }
    }

    /// Takes an image that is no longer in the map out of the sum.
    pub fn subtract(&mut self, image: &Image) {
        self.images -= 1;
        self.combine(image, [[0, 0], [self.n, self.n]], subtract);
    }

    /// Moves the sum to the square of a new image, and adds it. `others` are all images in the sum:
    /// newly covered cells are summed again.
    pub fn add_newest<'a>(
        &mut self,
        newest: &Image,
        others: impl Iterator<Item = &'a Image> + Clone,
    ) {
        let [down, right] =
            [0, 1].map(|axis| newest.corner[axis].saturating_sub(self.corner[axis]));
        self.corner = newest.corner;
        for part in self.move_sum(down, right) {
            for other in others.clone() {
                self.combine(other, part, add);
            }
        }
        self.images += 1;
        self.combine(newest, [[0, 0], [self.n, self.n]], add);
    }

    /// Moves the square of the sum by so many cells, and empties the newly covered ones: the rows
    /// and the columns that are returned, each as the first cell and the one behind the last, (x,
    /// y).
    fn move_sum(&mut self, down: i64, right: i64) -> [[[usize; 2]; 2]; 2] {
        let n = self.n;
        let (rows, columns) = (exposed(down, n), exposed(right, n));
        let kept = n - (columns.end - columns.start);
        let (to, from) = if right >= 0 {
            (0, n - kept)
        } else {
            (n - kept, 0)
        };
        let mut move_row = |row: usize| {
            let source = (row as i64 + down) as usize * n + from;
            self.sum.copy_within(source..source + kept, row * n + to);
        };
        // Each row is moved before another takes its place.
        if down >= 0 {
            (0..rows.start).for_each(&mut move_row);
        } else {
            (rows.end..n).rev().for_each(&mut move_row);
        }
        let parts = [
            [[rows.start, 0], [rows.end, n]],
            // The rows above have these columns already.
            if down >= 0 {
                [[0, columns.start], [rows.start, columns.end]]
            } else {
                [[rows.end, columns.start], [n, columns.end]]
            },
        ];
        for [first, end] in parts {
            for row in first[0]..end[0] {
                self.sum[row * n + first[1]..row * n + end[1]].fill(0);
            }
        }
        parts
    }

    /// Combines a part of the sum, from its first cell (x, y) to the one behind its last, with an
    /// image.
    fn combine(
        &mut self,
        image: &Image,
        [first, end]: [[usize; 2]; 2],
        with: impl Fn(&[u8], &mut [u16]),
    ) {
        let n = self.n as i64;
        let off = [0, 1].map(|axis| image.corner[axis].saturating_sub(self.corner[axis]));
        let [rows, columns] = [0, 1].map(|axis| {
            let (first, end) = (first[axis] as i64, end[axis] as i64);
            first.max(off[axis])..end.min(off[axis] + n)
        });
        if columns.is_empty() {
            return;
        }
        for row in rows {
            let to = (row * n + columns.start) as usize..(row * n + columns.end) as usize;
            let from = ((row - off[0]) * n + columns.start - off[1]) as usize;
            let from = &image.cells[from..from + to.len()];
            with(from, &mut self.sum[to]);
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

/// Returns the newly covered cells of a range of n cells that moves by `by` cells.
fn exposed(by: i64, n: usize) -> std::ops::Range<usize> {
    let count = by.unsigned_abs().min(n as u64) as usize;
    if by >= 0 { n - count..n } else { 0..count }
}

struct Drawing {
    pose: Pose,
    /// The map's cell (x, y) that the drawing begins with.
    corner: [i64; 2],
    per_m: f64,
    n: usize,
}

/// Shares each point between the four cells around it, and blurs them.
#[simd]
fn spread(points: &DeskewedPoints, place: &Drawing, drawing: &mut [f32], drawn: &mut [bool]) {
    let &Drawing {
        pose,
        corner,
        per_m,
        n,
    } = place;
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
        let across = shares((u - i as f64) as f32).map(|share| weight * share);
        let along = shares((v - j as f64) as f32);
        let first = (i - BLUR_REACH) * n + j - BLUR_REACH;
        for (first, across) in (first..).step_by(n).zip(across) {
            drawn[first / CHUNK] = true;
            drawn[(first + SPREAD - 1) / CHUNK] = true;
            if let Some(cells) = drawing[first..].first_chunk_mut::<SPREAD>() {
                for (cell, along) in cells.iter_mut().zip(along) {
                    *cell += across * along;
                }
            }
        }
    }
}

/// Returns the weights of the cells along an axis, for a point that lies this fraction of a cell
/// behind the fourth of them.
#[inline(always)]
fn shares(behind: f32) -> [f32; SPREAD] {
    const NEAR: [f32; SPREAD] = [
        BLUR[3], BLUR[2], BLUR[1], BLUR[0], BLUR[1], BLUR[2], BLUR[3], 0.0,
    ];
    const BEHIND: [f32; SPREAD] = [
        0.0, BLUR[3], BLUR[2], BLUR[1], BLUR[0], BLUR[1], BLUR[2], BLUR[3],
    ];
    std::array::from_fn(|cell| (1.0 - behind) * NEAR[cell] + behind * BEHIND[cell])
}

/// Returns the mean of the drawn values, weighted by themselves; 1 without values.
#[simd]
fn mean(drawing: &[f32], drawn: &[bool]) -> f32 {
    let (mut sum, mut squares) = ([0.0_f32; CHUNK], [0.0_f32; CHUNK]);
    let (chunks, _) = drawing.as_chunks::<CHUNK>();
    for (chunk, _) in chunks.iter().zip(drawn).filter(|(_, drawn)| **drawn) {
        for lane in 0..CHUNK {
            sum[lane] += chunk[lane];
            squares[lane] += chunk[lane] * chunk[lane];
        }
    }
    let [sum, squares] = [sum, squares].map(|lanes| lanes.map(f64::from).iter().sum::<f64>());
    if sum > 0.0 {
        (squares / sum) as f32
    } else {
        1.0
    }
}

#[simd]
fn saturate(drawing: &mut [f32], drawn: &mut [bool], mean: f32, cells: &mut [u8]) {
    cells.fill(0);
    let chunks = drawing.chunks_mut(CHUNK).zip(cells.chunks_mut(CHUNK));
    for ((values, cells), drawn) in chunks.zip(drawn).filter(|(_, drawn)| **drawn) {
        for (cell, value) in cells.iter_mut().zip(values.iter()) {
            // By way of i32: the direct conversion is not vectorised.
            *cell = (FULL * value / (value + mean) + 0.5) as i32 as u8;
        }
        values.fill(0.0);
        *drawn = false;
    }
}

/// Adds an image to the sum. At most 64 images of at most 255 do not overflow.
#[simd]
fn add(cells: &[u8], sum: &mut [u16]) {
    sum.iter_mut()
        .zip(cells)
        .for_each(|(sum, cell)| *sum += u16::from(*cell));
}

/// Takes out of the sum an image that is in it.
#[simd]
fn subtract(cells: &[u8], sum: &mut [u16]) {
    sum.iter_mut()
        .zip(cells)
        .for_each(|(sum, cell)| *sum -= u16::from(*cell));
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

    fn brightest(level: &MapLevel) -> ([f64; 2], f32) {
        let view = level.view();
        let most = view.sum.iter().copied().max().unwrap_or(0);
        let at = view.sum.iter().position(|sum| *sum == most).unwrap_or(0);
        let cell = [at / level.n, at % level.n];
        let place = [0, 1].map(|axis| cell[axis] as f64 * level.cell_m + view.origin[axis]);
        (place, f32::from(most) / view.full)
    }

    #[test]
    fn one_place_seen_from_two_poses_falls_into_one_cell() {
        let mut level = MapLevel::new(0.5, 20.0);
        let (mut first, mut second) = (level.new_image(), level.new_image());
        level.draw(&points(&[[6.0, 2.0]]), &Pose::identity(), &mut first);
        let pose = pose(3.0, 1.0, std::f64::consts::FRAC_PI_2);
        let seen = pose.inverse() * Point2::new(6.0, 2.0);
        let seen = points(&[[seen.x as f32, seen.y as f32]]);
        level.draw(&seen, &pose, &mut second);
        level.sum_images([&first, &second].into_iter());
        let (place, share) = brightest(&level);
        assert_eq!(place, [6.0, 2.0]);
        // m / (m + mean): the mean of a Gaussian is half of its peak.
        assert!((share - 2.0 / 3.0).abs() < 0.01, "{share}");
    }

    proptest::proptest! {
        /// Wherever the vehicle drives, even back over places that have left the square.
        #[test]
        fn a_sum_that_is_kept_up_is_the_sum_of_all_images(
            steps in proptest::collection::vec((-120.0..120.0, -30.0..30.0), 1..12),
        ) {
            let mut kept = MapLevel::new(1.0, 10.0);
            let mut anew = MapLevel::new(1.0, 10.0);
            let mut images: Vec<Image> = Vec::new();
            let near: Vec<[f32; 2]> = (0..60).map(|k| [(k * 7 % 13 - 6) as f32, (k * 5 % 11 - 5) as f32]).collect();
            let mut at = [0.0, 0.0];
            for (dx, dy) in steps {
                at = [at[0] + dx / 4.0, at[1] + dy / 4.0];
                let mut image = kept.new_image();
                kept.draw(&points(&near), &pose(at[0], at[1], 0.3), &mut image);
                if images.len() == 4 {
                    kept.subtract(&images.remove(0));
                }
                kept.add_newest(&image, images.iter());
                images.push(image);
                anew.sum_images(images.iter());
                proptest::prop_assert_eq!(kept.view().sum, anew.view().sum);
                proptest::prop_assert_eq!(kept.view().full, anew.view().full);
            }
        }
    }

    /// The definition: the points are shared between the cells around them, and these are blurred
    /// one by one.
    fn drawn_directly(places: &[[f32; 2]], level: &MapLevel, corner: [i64; 2]) -> Vec<f64> {
        let n = level.n;
        let blur = |steps: usize| f64::from(BLUR.get(steps).copied().unwrap_or(0.0));
        let mut cells = vec![0.0; n * n];
        for place in places {
            let at = [0, 1].map(|axis| f64::from(place[axis]) / level.cell_m - corner[axis] as f64);
            for (index, cell) in cells.iter_mut().enumerate() {
                let there = [index / n, index % n];
                let share = |axis: usize| {
                    (0..n)
                        .map(|near| {
                            let bilinear = (1.0 - (near as f64 - at[axis]).abs()).max(0.0);
                            bilinear * blur(near.abs_diff(there[axis]))
                        })
                        .sum::<f64>()
                };
                *cell += share(0) * share(1);
            }
        }
        cells
    }

    #[test]
    fn a_drawing_is_the_saturated_blur_of_its_points() {
        let mut level = MapLevel::new(0.5, 8.0);
        let mut image = level.new_image();
        let places = [
            [0.3, 0.4],
            [1.1, 0.45],
            [-3.77, 2.2],
            [0.3, 0.41],
            [5.0, -5.0],
        ];
        // Twice: nothing of the first drawing is left.
        level.draw(&points(&[[2.0, 2.0]]), &Pose::identity(), &mut image);
        level.draw(&points(&places), &Pose::identity(), &mut image);
        let direct = drawn_directly(&places, &level, image.corner);
        let squares: f64 = direct.iter().map(|value| value * value).sum();
        let mean = squares / direct.iter().sum::<f64>();
        for (cell, value) in image.cells.iter().zip(&direct) {
            let expected = 255.0 * value / (value + mean);
            assert!(
                (f64::from(*cell) - expected).abs() < 0.51,
                "{cell}, {expected}"
            );
        }
        assert!(image.cells.iter().any(|cell| *cell > 100));
    }

    #[test]
    fn points_out_of_reach_are_ignored() {
        let mut level = MapLevel::new(1.0, 20.0);
        let mut image = level.new_image();
        let outside = points(&[[25.0, 0.0], [f32::NAN, 0.0], [0.0, -1e30]]);
        level.draw(&outside, &Pose::identity(), &mut image);
        assert!(image.cells.iter().all(|cell| *cell == 0));
        level.sum_images([&image].into_iter());
        assert!(level.view().sum.iter().all(|sum| *sum == 0));
    }
}
