//! Draws a run: one scan from above, and beside it all scans at the estimated poses with the trajectory over the ground truth.
//!
//! `cargo run --release -p gyre-radar --example picture -- RECORDING RUN PICTURE.png`
//!
//! RECORDING is the recording's folder, with its ground truth; RUN is the folder that `gyre run` left.

use std::{env, error::Error, f64::consts::TAU, fs::File, io::BufWriter, path::Path};

use gyre_radar::{
    DatasetOptions, OwnedScan, PolarScan, Sense, Trajectory,
    ground_truth::{find_ground_truth, read_trajectory},
    open,
};
use nalgebra::{Isometry2, Point2, Vector2};

/// Side of a panel and margin around it, pixels.
const SIDE: usize = 440;
const MARGIN: usize = 16;
const WIDTH: usize = 2 * SIDE + 3 * MARGIN;
const HEIGHT: usize = SIDE + 2 * MARGIN;
/// Spacing of rings and grid lines, m.
const GRID_M: f64 = 25.0;
/// Range of the scan shown, and of the returns that are added to the map, m.
const SCAN_REACH_M: f64 = 100.0;
const MAP_REACH_M: f64 = 60.0;
/// Gain of a map pixel towards a higher brightness, and the share of it towards a lower one.
const MAP_GAIN: f64 = 0.25;
const MAP_LOSS: f64 = 0.1;
/// Powers shown with minimum and maximum brightness.
const POWER: (f64, f64) = (50.0, 120.0);
/// Minimum range, m: nearer returns are of the vehicle itself.
const OWN_M: f64 = 3.0;

const BACKGROUND: Colour = [11.0, 16.0, 26.0];
const PANEL: Colour = [17.0, 24.0, 38.0];
const GRID: Colour = [58.0, 72.0, 96.0];
const TRUTH: Colour = [235.0, 240.0, 250.0];
const ESTIMATE: Colour = [255.0, 138.0, 36.0];
/// Colours by increasing brightness.
const GLOW: [Colour; 5] = [
    PANEL,
    [32.0, 74.0, 118.0],
    [38.0, 150.0, 160.0],
    [180.0, 214.0, 120.0],
    [255.0, 246.0, 196.0],
];

const STEPS: f64 = 24.0;

type Colour = [f64; 3];

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let [recording, run, picture] = arguments.as_slice() else {
        return Err("three arguments are needed: RECORDING RUN PICTURE.png".into());
    };
    let estimate = read_trajectory(&Path::new(run).join("trajectory.tum"))?;
    let truth =
        find_ground_truth(Path::new(recording)).ok_or("the recording has no ground truth")?;
    let truth = aligned(&read_trajectory(&truth)?, &estimate)?;
    let mut dataset = open(Path::new(recording), &DatasetOptions::default())?;

    let mut canvas = Canvas::new();
    let map = Map::around(&estimate);
    let mut scan = OwnedScan::with_limits(dataset.limits());
    let mut powers = vec![0.0_f64; SIDE * SIDE];
    for index in 0..dataset.len() {
        scan.geometry = dataset.read(index, scan.slot())?;
        let sampler = Sampler::new(scan.view());
        if let Some(poses) = sampler.poses(&estimate) {
            map.add(&mut powers, &sampler, &poses);
        }
        if index == dataset.len() / 3 {
            draw_scan(&mut canvas, &sampler);
        }
    }
    draw_map(&mut canvas, &map, &powers, &truth, &estimate);
    canvas.write(Path::new(picture))
}

/// Returns the ground truth, aligned to the first pose of the estimate.
fn aligned(
    truth: &Trajectory,
    estimate: &Trajectory,
) -> Result<Vec<Isometry2<f64>>, Box<dyn Error>> {
    let (first, last) = estimate.span_ns().ok_or("the trajectory has no times")?;
    let start = truth
        .near(first, 1_000_000)
        .ok_or("the ground truth does not cover the run")?;
    let stamps = truth.stamp_ns.iter().flatten();
    let within = stamps
        .zip(&truth.poses)
        .filter(|(at, _)| (first..=last).contains(*at));
    Ok(within
        .map(|(_, pose)| estimate.poses[0] * start.inv_mul(pose))
        .collect())
}

/// Samples the powers of a scan by position.
struct Sampler<'a> {
    scan: PolarScan<'a>,
    /// Nearest azimuth per uniform step from straight ahead, in the scan's sense.
    azimuths: Vec<usize>,
}

impl<'a> Sampler<'a> {
    fn new(scan: PolarScan<'a>) -> Self {
        let steps = scan.azimuth_rad.len();
        let distance = |azimuth: usize, angle: f64| {
            let apart = (f64::from(scan.azimuth_rad[azimuth]) - angle).rem_euclid(TAU);
            apart.min(TAU - apart)
        };
        let nearest = |step: usize| {
            let angle = TAU * step as f64 / steps as f64;
            (0..steps).min_by(|a, b| distance(*a, angle).total_cmp(&distance(*b, angle)))
        };
        Self {
            azimuths: (0..steps).filter_map(nearest).collect(),
            scan,
        }
    }

    /// Returns the pose of the sensor at the time of each step; beyond the ends of the trajectory, the nearest pose.
    fn poses(&self, trajectory: &Trajectory) -> Option<Vec<Isometry2<f64>>> {
        let (first, last) = trajectory.span_ns()?;
        let at = |azimuth: &usize| trajectory.at(self.scan.stamp_ns[*azimuth].clamp(first, last));
        self.azimuths.iter().map(at).collect()
    }

    /// Returns the fractional step towards a position in the sensor frame.
    fn step(&self, place: &Point2<f64>) -> f64 {
        let angle = match self.scan.geometry.sense {
            Sense::Clockwise => -place.y.atan2(place.x),
            Sense::CounterClockwise => place.y.atan2(place.x),
        };
        angle.rem_euclid(TAU) / TAU * self.azimuths.len() as f64
    }

    /// Returns the brightness, 0 to 1, at a position in the sensor frame, linear between azimuths.
    fn brightness(&self, place: &Point2<f64>) -> f64 {
        let range_m = place.coords.norm();
        if range_m < OWN_M {
            return 0.0;
        }
        let geometry = &self.scan.geometry;
        let bin = (range_m - f64::from(geometry.range_offset_m))
            / f64::from(geometry.range_resolution_m)
            - 0.5;
        let (at, steps) = (self.step(place), self.azimuths.len());
        let (step, share) = (at as usize % steps, at.fract());
        let power =
            (1.0 - share) * self.power(step, bin) + share * self.power((step + 1) % steps, bin);
        ((power - POWER.0) / (POWER.1 - POWER.0)).clamp(0.0, 1.0)
    }

    /// Returns the mean power of neighbouring bins, since a pixel covers more than one.
    fn power(&self, step: usize, bin: f64) -> f64 {
        let row = self.scan.row(self.azimuths[step]);
        let first = (bin - 1.5).max(0.0) as usize;
        let bins = row
            .get(first..(first + 4).min(row.len()))
            .unwrap_or_default();
        bins.iter().map(|power| f64::from(*power)).sum::<f64>() / bins.len().max(1) as f64
    }
}

/// The area of the map.
struct Map {
    centre: Vector2<f64>,
    m_per_pixel: f64,
}

impl Map {
    fn around(trajectory: &Trajectory) -> Self {
        let places = || trajectory.poses.iter().map(|pose| pose.translation.vector);
        let low = places().fold(Vector2::repeat(f64::MAX), |low, at| low.inf(&at));
        let high = places().fold(Vector2::repeat(f64::MIN), |high, at| high.sup(&at));
        Self {
            centre: (low + high) / 2.0,
            m_per_pixel: ((high - low).max() + MAP_REACH_M) / SIDE as f64,
        }
    }

    fn place(&self, column: usize, row: usize) -> Point2<f64> {
        let from_centre =
            |pixel: usize| (pixel as f64 + 0.5 - SIDE as f64 / 2.0) * self.m_per_pixel;
        Point2::new(
            self.centre.x - from_centre(row),
            self.centre.y - from_centre(column),
        )
    }

    fn pixel(&self, place: Vector2<f64>) -> (f64, f64) {
        let at = (self.centre - place) / self.m_per_pixel + Vector2::repeat(SIDE as f64 / 2.0);
        (at.y, at.x)
    }

    /// Adds a scan, motion-compensated: each azimuth from the sensor's pose at its time.
    fn add(&self, powers: &mut [f64], sampler: &Sampler, poses: &[Isometry2<f64>]) {
        let middle = poses[poses.len() / 2];
        for (index, power) in powers.iter_mut().enumerate() {
            let place = self.place(index % SIDE, index / SIDE);
            let about = middle.inverse_transform_point(&place);
            if about.coords.norm() < MAP_REACH_M {
                let pose = poses[sampler.step(&about) as usize % poses.len()];
                let seen = sampler.brightness(&pose.inverse_transform_point(&place));
                *power += MAP_GAIN * (seen - *power).max(MAP_LOSS * (seen - *power));
            }
        }
    }
}

fn draw_scan(canvas: &mut Canvas, sampler: &Sampler) {
    let half = SIDE as f64 / 2.0;
    let m_per_pixel = SCAN_REACH_M / half;
    canvas.shade(MARGIN, |column, row| {
        let (right, ahead) = (column - half, half - row);
        let range_m = right.hypot(ahead) * m_per_pixel;
        let colour = glow(
            sampler
                .brightness(&Point2::new(ahead, -right).map(|at| at * m_per_pixel))
                .sqrt(),
        );
        let ring = (range_m / GRID_M - (range_m / GRID_M).round()).abs() * GRID_M / m_per_pixel;
        let colour = mix(colour, GRID, 0.6 * (1.0 - ring).max(0.0));
        mix(
            colour,
            BACKGROUND,
            (right.hypot(ahead) - half + 1.0).clamp(0.0, 1.0),
        )
    });
    let (x, y) = (MARGIN as f64 + half, MARGIN as f64 + half);
    canvas.line(
        &[
            (x - 5.0, y + 6.0),
            (x, y - 8.0),
            (x + 5.0, y + 6.0),
            (x - 5.0, y + 6.0),
        ],
        2.0,
        ESTIMATE,
    );
}

fn draw_map(
    canvas: &mut Canvas,
    map: &Map,
    powers: &[f64],
    truth: &[Isometry2<f64>],
    estimate: &Trajectory,
) {
    let left = 2 * MARGIN + SIDE;
    canvas.shade(left, |column, row| {
        let index = row as usize * SIDE + column as usize;
        let place = map.place(column as usize, row as usize);
        let off = |value: f64| {
            (value / GRID_M - (value / GRID_M).round()).abs() * GRID_M / map.m_per_pixel
        };
        let line = (1.0 - off(place.x).min(off(place.y))).max(0.0);
        mix(
            glow(0.9 * (powers[index] - 0.03).max(0.0).sqrt()),
            GRID,
            0.35 * line,
        )
    });
    let on_canvas = |pose: &Isometry2<f64>| {
        let (column, row) = map.pixel(pose.translation.vector);
        (left as f64 + column, MARGIN as f64 + row)
    };
    let truth: Vec<_> = truth.iter().map(on_canvas).collect();
    let estimate: Vec<_> = estimate.poses.iter().map(on_canvas).collect();
    canvas.line(&truth, 6.0, TRUTH);
    canvas.line(&estimate, 2.5, ESTIMATE);
    if let (Some(first), Some(last)) = (estimate.first(), estimate.last()) {
        canvas.line(&[*first, *first], 9.0, TRUTH);
        canvas.line(&[*last, *last], 9.0, ESTIMATE);
    }
}

fn glow(brightness: f64) -> Colour {
    // Few steps keep the file small.
    let brightness = (brightness.clamp(0.0, 1.0) * STEPS).round() / STEPS;
    let at = brightness * (GLOW.len() - 1) as f64;
    let step = (at as usize).min(GLOW.len() - 2);
    mix(GLOW[step], GLOW[step + 1], at - step as f64)
}

fn mix(from: Colour, to: Colour, share: f64) -> Colour {
    std::array::from_fn(|i| from[i] + share * (to[i] - from[i]))
}

struct Canvas(Vec<Colour>);

impl Canvas {
    fn new() -> Self {
        Self(vec![BACKGROUND; WIDTH * HEIGHT])
    }

    /// Sets each pixel of the panel that begins at a column, by its place in the panel.
    fn shade(&mut self, left: usize, colour: impl Fn(f64, f64) -> Colour) {
        for row in 0..SIDE {
            for column in 0..SIDE {
                self.0[(MARGIN + row) * WIDTH + left + column] = colour(column as f64, row as f64);
            }
        }
    }

    /// Draws a line with round ends and smooth edges.
    fn line(&mut self, points: &[(f64, f64)], width: f64, colour: Colour) {
        let mut cover = vec![0.0_f64; WIDTH * HEIGHT];
        for ends in points.windows(2) {
            let (low, high) = bounds(ends, width);
            for row in low.1..high.1 {
                for column in low.0..high.0 {
                    let off = distance((column as f64 + 0.5, row as f64 + 0.5), ends[0], ends[1]);
                    let share = (width / 2.0 - off + 0.5).clamp(0.0, 1.0);
                    let pixel = &mut cover[row * WIDTH + column];
                    *pixel = pixel.max(share);
                }
            }
        }
        for (pixel, share) in self.0.iter_mut().zip(cover) {
            *pixel = mix(*pixel, colour, share);
        }
    }

    fn write(&self, path: &Path) -> Result<(), Box<dyn Error>> {
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)?;
        }
        let file = BufWriter::new(File::create(path)?);
        let mut encoder = png::Encoder::new(file, WIDTH as u32, HEIGHT as u32);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_compression(png::Compression::High);
        let bytes: Vec<u8> = self
            .0
            .iter()
            .flatten()
            .map(|value| value.round() as u8)
            .collect();
        encoder.write_header()?.write_image_data(&bytes)?;
        Ok(())
    }
}

/// The pixels that a line may touch: from, to.
fn bounds(ends: &[(f64, f64)], width: f64) -> ((usize, usize), (usize, usize)) {
    let along = |value: fn(&(f64, f64)) -> f64, size: usize| {
        let low = ends.iter().map(value).fold(f64::MAX, f64::min) - width;
        let high = ends.iter().map(value).fold(f64::MIN, f64::max) + width;
        (
            low.max(0.0) as usize,
            (high.max(0.0) as usize + 1).min(size),
        )
    };
    let (columns, rows) = (along(|end| end.0, WIDTH), along(|end| end.1, HEIGHT));
    ((columns.0, rows.0), (columns.1, rows.1))
}

/// Distance of a point from a stretch.
fn distance(point: (f64, f64), from: (f64, f64), to: (f64, f64)) -> f64 {
    let point = Vector2::new(point.0 - from.0, point.1 - from.1);
    let along = Vector2::new(to.0 - from.0, to.1 - from.1);
    let share = (point.dot(&along) / along.norm_squared().max(1e-9)).clamp(0.0, 1.0);
    (point - along * share).norm()
}
