use std::{f32::consts::SQRT_2, f64::consts::TAU};

use gyre_geometry::scan::Sense;

pub(super) const BLOCK: usize = 32;

pub(super) type Block<T> = [T; BLOCK];

/// The centres of all cells, Cartesian and polar, in a frame whose second axis `z` points towards
/// increasing azimuths: y for counter-clockwise sensors, -y for clockwise ones. The kernels
/// therefore need not know the sense of rotation. Rows are padded to whole blocks with cells at the
/// sensor.
#[derive(Debug)]
pub(super) struct Cells {
    n: usize,
    cell_m: f32,
    sense: Sense,
    z_m: Vec<Block<f32>>,
    /// Bearing from straight ahead towards `z`, turns in `[0, 1]`, row by row.
    bearing: Vec<Block<f32>>,
    range_m: Vec<Block<f32>>,
    pub max_range_m: f32,
}

pub(super) struct CellRow<'a> {
    pub x_m: f32,
    pub z_m: &'a [Block<f32>],
    pub bearing: &'a [Block<f32>],
    pub range_m: &'a [Block<f32>],
}

impl Cells {
    pub fn new(n: usize, cell_m: f32, sense: Sense) -> Self {
        let blocks = n.div_ceil(BLOCK);
        let mut cells = Self {
            n,
            cell_m,
            sense,
            z_m: vec![[0.0; BLOCK]; blocks],
            bearing: vec![[0.0; BLOCK]; n * blocks],
            range_m: vec![[0.0; BLOCK]; n * blocks],
            max_range_m: 0.5 * (n as f32 - 1.0) * cell_m * SQRT_2,
        };
        cells.compute();
        cells
    }

    /// Sets the sense of rotation. A dataset has one, so the cells are recomputed at most once.
    pub fn set_sense(&mut self, sense: Sense) {
        if self.sense != sense {
            self.sense = sense;
            self.compute();
        }
    }

    pub fn blocks(&self) -> usize {
        self.z_m.len()
    }

    pub fn row(&self, index: usize) -> CellRow<'_> {
        let blocks = index * self.blocks()..(index + 1) * self.blocks();
        CellRow {
            x_m: self.offset_m(index) as f32,
            z_m: &self.z_m,
            bearing: &self.bearing[blocks.clone()],
            range_m: &self.range_m[blocks],
        }
    }

    fn offset_m(&self, index: usize) -> f64 {
        (0.5 * (self.n as f64 - 1.0) - index as f64) * f64::from(self.cell_m)
    }

    fn compute(&mut self) {
        let side = match self.sense {
            Sense::Clockwise => -1.0,
            Sense::CounterClockwise => 1.0,
        };
        for row in 0..self.n {
            let x = self.offset_m(row);
            for column in 0..self.n {
                let z = side * self.offset_m(column);
                let (block, k) = (column / BLOCK, column % BLOCK);
                let of_row = row * self.blocks() + block;
                self.z_m[block][k] = z as f32;
                self.bearing[of_row][k] = (z.atan2(x) / TAU).rem_euclid(1.0) as f32;
                self.range_m[of_row][k] = x.hypot(z) as f32;
            }
        }
    }
}
