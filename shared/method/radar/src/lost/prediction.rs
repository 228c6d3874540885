//! The scan before as the sensor would see it now.

use std::f32::consts::TAU;

use gyre_geometry::{
    Pose, Twist,
    scan::{PolarScan, Sense},
};
use gyre_simd::simd;
use nalgebra::Vector2;

use super::echoes::{EchoRow, Echoes, Layout};
use crate::raster::kernels::integer_below;

/// Range for determining the time between two looks in one direction, m.
const TYPICAL_M: f32 = 30.0;
/// Azimuths before the turn and beyond it that a prediction has.
const BEFORE: usize = 8;
const BEYOND: usize = 88;
const BLOCK: usize = 16;

/// The motion of the sensor from one turn to the next: at a constant velocity, so between two looks
/// at the same azimuth by the same motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motion {
    /// The pose after a turn, in the sense of the azimuths.
    pose: Pose,
    /// Change of that pose, in the same frame: m/s and rad/s.
    velocity_mps: Vector2<f64>,
    yaw_rate_radps: f64,
    turn_s: f64,
}

impl Motion {
    pub fn new(before_ns: i64, scan: &PolarScan<'_>, twist: &Twist) -> Self {
        let twist = match scan.geometry.sense {
            Sense::Clockwise => twist.mirrored(),
            Sense::CounterClockwise => *twist,
        };
        let between_ns = scan.geometry.stamp_ns.saturating_sub(before_ns);
        let pose = twist.pose_at(between_ns as f64 * 1e-9);
        Self {
            pose,
            velocity_mps: pose.rotation * Vector2::new(twist.vx_mps, twist.vy_mps),
            yaw_rate_radps: twist.yaw_rate_radps,
            turn_s: scan.time_s(scan.geometry.azimuths - 1) - scan.time_s(0),
        }
    }

    /// Returns the sensor at the time of its next look at a thing that it saw in a direction, given
    /// as sine and cosine.
    fn seen_from(&self, [sin, cos]: [f32; 2]) -> Moved {
        let after = |later_s: f64| {
            let at_m = self.pose.translation.vector + self.velocity_mps * later_s;
            Moved {
                x_m: at_m.x as f32,
                y_m: at_m.y as f32,
                yaw_rad: (self.pose.rotation.angle() + self.yaw_rate_radps * later_s) as f32,
                sin,
                cos,
            }
        };
        // Now it sees that earlier in its turn, or later.
        let (turned_rad, _) = after(0.0).sees(TYPICAL_M);
        after(f64::from(turned_rad / TAU) * self.turn_s)
    }
}

/// The sensor in its frame of one turn before, and a direction of then.
struct Moved {
    x_m: f32,
    y_m: f32,
    yaw_rad: f32,
    sin: f32,
    cos: f32,
}

impl Moved {
    /// Returns the displacement along the turn, rad, of a thing that the sensor saw in that
    /// direction at a range, and its range, m.
    #[inline(always)]
    fn sees(&self, range_m: f32) -> (f32, f32) {
        let along = (range_m - self.x_m * self.cos - self.y_m * self.sin).max(0.1);
        let across = self.x_m * self.sin - self.y_m * self.cos;
        let slope = (across / along).clamp(-1.0, 1.0);
        // The arc tangent, to 0.005 rad.
        let turned = slope / (1.0 + 0.28 * slope * slope);
        (turned - self.yaw_rad, along * (1.0 + slope * slope).sqrt())
    }
}

#[derive(Clone, Debug, Default)]
pub(super) struct Prediction {
    layout: Layout,
    /// Cell x azimuth, with those [`BEFORE`] the turn and [`BEYOND`] it.
    powers: Vec<f32>,
    /// Sum of the squares of an azimuth's powers.
    energies: Vec<f32>,
}

impl Prediction {
    pub fn make(&mut self, before: &Echoes, motion: &Motion) {
        self.layout = before.layout;
        self.powers.clear();
        self.powers.resize(self.width() * self.layout.cells, 0.0);
        let frame = Frame::new(&self.layout, self.width());
        for row in before.rows() {
            let from = motion.seen_from(row.direction);
            draw(&row, &from, &frame, &mut self.powers);
        }
        self.close();
    }

    fn close(&mut self) {
        let (width, azimuths) = (self.width(), self.layout.azimuths);
        self.energies.clear();
        self.energies.resize(width, 0.0);
        for powers in self.powers.chunks_exact_mut(width) {
            powers[BEFORE] += powers[BEFORE + azimuths];
            powers.copy_within(BEFORE..BEFORE + BEYOND, BEFORE + azimuths);
            powers.copy_within(azimuths..azimuths + BEFORE, 0);
        }
        add_squares(&self.powers, &mut self.energies);
    }

    fn width(&self) -> usize {
        BEFORE + self.layout.azimuths + BEYOND
    }

    /// Returns the powers of a cell at an azimuth and at those behind it.
    #[inline(always)]
    pub fn from<const WIDTH: usize>(&self, cell: u16, azimuth: isize) -> &[f32; WIDTH] {
        let width = self.width();
        around(&self.powers[usize::from(cell) * width..][..width], azimuth)
    }

    /// Returns the sums of the squares of the powers of an azimuth and of those behind it.
    #[inline(always)]
    pub fn energies<const WIDTH: usize>(&self, azimuth: isize) -> &[f32; WIDTH] {
        around(&self.energies, azimuth)
    }
}

/// Returns the values at an azimuth and behind it, of those from [`BEFORE`] the turn on.
#[inline(always)]
fn around<const WIDTH: usize>(values: &[f32], azimuth: isize) -> &[f32; WIDTH] {
    let from = (azimuth + BEFORE as isize) as usize;
    let chunk = values[from..].first_chunk();
    chunk.expect("the turn and what is beyond it hold all that a row is compared with")
}

/// The numbers that lead from a position to its place among the predicted powers.
#[derive(Clone, Copy, Debug)]
struct Frame {
    first_m: f32,
    cell_m: f32,
    per_rad: f32,
    azimuths: f32,
    last_cell: f32,
    width: u32,
}

impl Frame {
    fn new(layout: &Layout, width: usize) -> Self {
        Self {
            first_m: layout.first_m,
            cell_m: layout.cell_m,
            per_rad: layout.azimuths as f32 / TAU,
            azimuths: layout.azimuths as f32,
            last_cell: layout.cells as f32 - 1.0,
            width: width as u32,
        }
    }

    /// Returns the azimuth in the turn, from one that may lie a turn beside it.
    #[inline(always)]
    fn in_turn(&self, azimuth: f32) -> f32 {
        if azimuth < 0.0 {
            azimuth + self.azimuths
        } else if azimuth >= self.azimuths {
            azimuth - self.azimuths
        } else {
            azimuth
        }
    }
}

/// Powers that are distributed over the azimuths and cells on both sides.
#[derive(Clone, Copy, Debug, Default)]
struct Places {
    /// The first azimuth in the nearer cell. The azimuth behind the last is one beyond the turn.
    first: [u32; BLOCK],
    /// The shares of the nearer cell, at this azimuth and at the one behind it.
    near: [[f32; BLOCK]; 2],
    far: [[f32; BLOCK]; 2],
}

#[simd]
fn draw(row: &EchoRow, from: &Moved, frame: &Frame, powers: &mut [f32]) {
    let ((cells, rest), (of_cells, of_rest)) = (
        row.cells.as_chunks::<BLOCK>(),
        row.powers.as_chunks::<BLOCK>(),
    );
    for (cells, of_cells) in cells.iter().zip(of_cells) {
        add(
            &locate(row.at, cells, of_cells, from, frame),
            BLOCK,
            frame,
            powers,
        );
    }
    let (mut cells, mut of_cells) = ([0; BLOCK], [0.0; BLOCK]);
    cells[..rest.len()].copy_from_slice(rest);
    of_cells[..rest.len()].copy_from_slice(of_rest);
    add(
        &locate(row.at, &cells, &of_cells, from, frame),
        rest.len(),
        frame,
        powers,
    );
}

#[inline(always)]
fn locate(
    at: f32,
    cells: &[u16; BLOCK],
    powers: &[f32; BLOCK],
    from: &Moved,
    frame: &Frame,
) -> Places {
    let mut places = Places::default();
    for k in 0..BLOCK {
        let (turned_rad, range_m) = from.sees(frame.first_m + f32::from(cells[k]) * frame.cell_m);
        let azimuth = frame.in_turn(at + turned_rad * frame.per_rad);
        let cell = (range_m - frame.first_m) / frame.cell_m;
        // What lies in no cell adds nothing to the first.
        let is_inside = cell >= 0.0 && cell < frame.last_cell;
        let (cell, power) = if is_inside {
            (cell, powers[k])
        } else {
            (0.0, 0.0)
        };
        let low = integer_below(azimuth).min(frame.azimuths as i32);
        let near = integer_below(cell);
        let (share, depth) = (azimuth - low as f32, cell - near as f32);
        places.first[k] = near as u32 * frame.width + BEFORE as u32 + low as u32;
        let (near, far) = (power * (1.0 - depth), power * depth);
        (places.near[0][k], places.near[1][k]) = (near * (1.0 - share), near * share);
        (places.far[0][k], places.far[1][k]) = (far * (1.0 - share), far * share);
    }
    places
}

#[inline(always)]
fn add(places: &Places, count: usize, frame: &Frame, powers: &mut [f32]) {
    let width = frame.width as usize;
    for k in 0..count.min(BLOCK) {
        let sums = &mut powers[places.first[k] as usize..][..width + 2];
        sums[0] += places.near[0][k];
        sums[1] += places.near[1][k];
        sums[width] += places.far[0][k];
        sums[width + 1] += places.far[1][k];
    }
}

#[simd]
fn add_squares(powers: &[f32], sums: &mut [f32]) {
    for powers in powers.chunks_exact(sums.len()) {
        for (sum, power) in sums.iter_mut().zip(powers) {
            *sum += power * power;
        }
    }
}
