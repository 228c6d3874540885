//! Echoes of a scan, which are aligned: its powers above a floor in cells of range.

use super::LostAzimuths;
use crate::scan::PolarScan;

/// Depth of a cell, m: about that of a pulse's echo on a wall.
const CELL_M: f32 = 0.7;
/// Least range of a cell, m: nearer is the vehicle.
const NEAR_M: f32 = 4.0;
/// Mean power of a cell without a return.
const FLOOR: f32 = 60.0;

/// The cells of a turn.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Layout {
    pub azimuths: usize,
    /// Cells per azimuth.
    pub cells: usize,
    bins_per_cell: usize,
    first_bin: usize,
    /// Range of the first cell's centre, m.
    pub first_m: f32,
    pub cell_m: f32,
}

impl Layout {
    pub fn of(scan: &PolarScan<'_>) -> Self {
        let geometry = &scan.geometry;
        let bin_m = geometry.range_resolution_m;
        let bins_per_cell = ((CELL_M / bin_m).round() as usize).max(1);
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

/// A cell with a return.
#[derive(Clone, Copy, Debug)]
pub(super) struct Echo {
    /// Row, or azimuth in steps of the turn.
    pub at: f32,
    pub cell: u16,
    pub power: f32,
}

/// The echoes of a scan, by row.
#[derive(Clone, Debug, Default)]
pub(super) struct Echoes {
    pub layout: Layout,
    pub echoes: Vec<Echo>,
}

impl Echoes {
    /// Reads the measured rows of a scan.
    pub fn read(&mut self, scan: &PolarScan<'_>) {
        self.layout = Layout::of(scan);
        self.echoes.clear();
        for row in 0..self.layout.azimuths - super::stale_rows(scan) {
            let bins = &scan.row(row)[self.layout.first_bin..];
            let cells = bins.chunks_exact(self.layout.bins_per_cell);
            for (cell, bins) in cells.take(self.layout.cells).enumerate() {
                let sum: u32 = bins.iter().map(|bin| u32::from(*bin)).sum();
                let power = sum as f32 / bins.len() as f32 - FLOOR;
                if power > 0.0 {
                    self.echoes.push(Echo {
                        at: row as f32,
                        cell: cell as u16,
                        power,
                    });
                }
            }
        }
    }

    /// Sets the echoes to those of the rows, at their azimuths. An azimuth that was lost has half
    /// the power of the rows on both sides.
    pub fn place(&mut self, rows: &Self, lost: &LostAzimuths) {
        self.layout = rows.layout;
        self.echoes.clear();
        for row in rows.echoes.chunk_by(|a, b| a.at == b.at) {
            let [before, at, after] =
                [-1.0, 0.0, 1.0].map(|step| lost.azimuth_of(row[0].at + step));
            let mut place = |at: f32, share: f32| {
                let placed = row.iter().map(|echo| Echo {
                    at,
                    power: share * echo.power,
                    ..*echo
                });
                self.echoes.extend(placed);
            };
            place(at, 1.0);
            if at - before > 1.5 {
                place(at - 1.0, 0.5);
            }
            if after - at > 1.5 {
                place(at + 1.0, 0.5);
            }
        }
    }
}
