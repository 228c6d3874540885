//! Echoes of a scan, which are aligned: its powers above a floor in cells of range.

use std::f32::consts::TAU;

use gyre_simd::simd;

use super::LostAzimuths;
use crate::raster::kernels::window::sum_pieces;
use gyre_geometry::scan::PolarScan;

/// Depth of a cell, m: about a pulse's echo on a wall.
const CELL_M: f32 = 0.7;
/// Least range of a cell, m: nearer is the vehicle.
const NEAR_M: f32 = 4.0;
const FLOOR: f32 = 60.0;
/// The most bins of a cell: their sum must fit 16 bits.
const MAX_BINS_PER_CELL: usize = 128;
/// Cells that are passed over together where none of them has a return.
const BLOCK: usize = 16;

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Layout {
    pub azimuths: usize,
    pub cells: usize,
    bins_per_cell: usize,
    first_bin: usize,
    pub first_m: f32,
    pub cell_m: f32,
}

impl Layout {
    pub fn of(scan: &PolarScan<'_>) -> Self {
        let geometry = &scan.geometry;
        let bin_m = geometry.range_resolution_m;
        let bins_per_cell = ((CELL_M / bin_m).round() as usize).clamp(1, MAX_BINS_PER_CELL);
        let first_bin = ((NEAR_M - geometry.range_offset_m) / bin_m).max(0.0) as usize;
        let first_bin = first_bin.min(geometry.bins);
        Self {
            azimuths: geometry.azimuths,
            cells: (geometry.bins - first_bin) / bins_per_cell,
            bins_per_cell,
            first_bin,
            first_m: scan.range_m(first_bin as f32 + 0.5 * (bins_per_cell as f32 - 1.0)),
            cell_m: bin_m * bins_per_cell as f32,
        }
    }
}

/// The echoes of a row, or of an azimuth that lies between two.
#[derive(Clone, Copy, Debug)]
pub(super) struct EchoRow<'a> {
    /// The row, or its azimuth in steps of the turn.
    pub at: f32,
    /// Sine and cosine of that azimuth, if it is one.
    pub direction: [f32; 2],
    pub cells: &'a [u16],
    pub powers: &'a [f32],
}

/// The echoes of a scan, row by row. Rows without any are left out.
#[derive(Clone, Debug, Default)]
pub(super) struct Echoes {
    pub layout: Layout,
    rows: Vec<Row>,
    cells: Vec<u16>,
    powers: Vec<f32>,
    sums: Vec<u16>,
}

#[derive(Clone, Copy, Debug)]
struct Row {
    at: f32,
    direction: [f32; 2],
    /// Echoes up to its end.
    end: usize,
}

impl Echoes {
    pub fn read(&mut self, scan: &PolarScan<'_>) {
        self.begin(Layout::of(scan));
        let Layout {
            azimuths,
            cells,
            bins_per_cell,
            first_bin,
            ..
        } = self.layout;
        let bins = cells * bins_per_cell;
        let room = cells.next_multiple_of(BLOCK);
        self.sums.clear();
        self.sums.resize(room, 0);
        for row in 0..azimuths - super::stale_rows(scan) {
            let powers = &scan.row(row)[first_bin..][..bins];
            sum_pieces(powers, bins_per_cell, &mut self.sums[..cells]);
            let start = self.powers.len();
            self.cells.resize(start + room, 0);
            self.powers.resize(start + room, 0.0);
            let (cells, powers) = (&mut self.cells[start..], &mut self.powers[start..]);
            let count = above_floor(&self.sums, bins_per_cell, cells, powers);
            self.end_row(row as f32, [0.0; 2], start + count);
        }
    }

    /// Sets the echoes to the echoes of the rows, at their azimuths. An azimuth that was lost has
    /// half the power of the rows on both sides.
    pub fn place(&mut self, rows: &Self, lost: &LostAzimuths) {
        self.begin(rows.layout);
        for row in rows.rows() {
            let [before, at, after] = [-1.0, 0.0, 1.0].map(|step| lost.azimuth_of(row.at + step));
            self.add(at, &row, 1.0);
            if at - before > 1.5 {
                self.add(at - 1.0, &row, 0.5);
            }
            if after - at > 1.5 {
                self.add(at + 1.0, &row, 0.5);
            }
        }
    }

    pub fn rows(&self) -> impl Iterator<Item = EchoRow<'_>> {
        let mut start = 0;
        self.rows.iter().map(move |row| {
            let echoes = start..row.end;
            start = row.end;
            EchoRow {
                at: row.at,
                direction: row.direction,
                cells: &self.cells[echoes.clone()],
                powers: &self.powers[echoes],
            }
        })
    }

    fn begin(&mut self, layout: Layout) {
        self.layout = layout;
        self.rows.clear();
        self.cells.clear();
        self.powers.clear();
    }

    fn add(&mut self, at: f32, row: &EchoRow<'_>, share: f32) {
        self.cells.extend_from_slice(row.cells);
        self.powers
            .extend(row.powers.iter().map(|power| share * power));
        let (sin, cos) = (at / (self.layout.azimuths as f32 / TAU)).sin_cos();
        self.end_row(at, [sin, cos], self.powers.len());
    }

    fn end_row(&mut self, at: f32, direction: [f32; 2], end: usize) {
        self.cells.truncate(end);
        self.powers.truncate(end);
        if self.rows.last().map_or(0, |row| row.end) < end {
            self.rows.push(Row { at, direction, end });
        }
    }
}

/// Writes the cells of a row whose mean power is above the floor, and by how much, to the starts of
/// `cells` and `powers`, which have room for all. Returns their number. `sums` are of `bins` each,
/// whole blocks.
#[simd]
fn above_floor(sums: &[u16], bins: usize, cells: &mut [u16], powers: &mut [f32]) -> usize {
    let mut count = 0;
    for (block, first) in sums.as_chunks::<BLOCK>().0.iter().zip((0..).step_by(BLOCK)) {
        let above = block.map(|sum| f32::from(sum) / bins as f32 - FLOOR);
        // Far away most blocks have none.
        if !above.iter().fold(false, |any, power| any | (*power > 0.0)) {
            continue;
        }
        for (power, cell) in above.into_iter().zip(first..) {
            (cells[count], powers[count]) = (cell, power);
            count += usize::from(power > 0.0);
        }
    }
    count
}
