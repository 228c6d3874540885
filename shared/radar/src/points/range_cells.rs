//! The scan in range cells: sums of a whole number of bins, with the floor taken off.

use super::PointsConfig;
use crate::scan::{PolarScan, flag};

/// The most bins of a cell: their sum must fit an i16, whose comparisons every vector unit has.
const MAX_BINS_A_CELL: usize = 128;

/// The largest power of a cell.
pub(super) const MAX_POWER: usize = MAX_BINS_A_CELL * 255;

/// Powers of the cells between the nearest and the furthest range, in units of the scan's power over the bins of a cell.
#[derive(Debug, Default)]
pub(super) struct RangeCells {
    layout: Layout,
    /// Row-major, an azimuth each row.
    powers: Vec<i16>,
    /// Which azimuths have anything above the floor and were measured.
    lit: Vec<bool>,
}

/// Which bins make which cells.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Layout {
    bins_a_cell: usize,
    /// The scan's cells before the first one that is kept.
    skipped: usize,
    /// Cells that are kept.
    cells: usize,
    cell_m: f32,
    range_offset_m: f32,
}

impl Layout {
    fn new(scan: &PolarScan<'_>, config: &PointsConfig) -> Self {
        let geometry = &scan.geometry;
        let bins_a_cell = (config.range_cell_m / geometry.range_resolution_m).round() as usize;
        let bins_a_cell = bins_a_cell.clamp(1, MAX_BINS_A_CELL);
        let cell_m = geometry.range_resolution_m * bins_a_cell as f32;
        let place = |range_m: f32| (range_m - geometry.range_offset_m) / cell_m - 0.5;
        let skipped = place(config.min_range_m).ceil().max(0.0) as usize;
        let end = ((place(config.max_range_m) + 1.0).floor().max(0.0) as usize)
            .min(geometry.bins / bins_a_cell);
        let cells = end.saturating_sub(skipped);
        Self {
            bins_a_cell,
            skipped,
            cells,
            cell_m,
            range_offset_m: geometry.range_offset_m,
        }
    }
}

impl RangeCells {
    /// Takes the powers of a scan that passed its check.
    pub fn measure(&mut self, scan: &PolarScan<'_>, floor: u8, config: &PointsConfig) {
        self.layout = Layout::new(scan, config);
        let (
            azimuths,
            Layout {
                bins_a_cell,
                skipped,
                cells,
                ..
            },
        ) = (scan.geometry.azimuths, self.layout);
        self.powers.resize(azimuths * cells, 0);
        self.lit.clear();
        self.lit.resize(azimuths, false);
        for azimuth in
            (0..azimuths).filter(|&azimuth| cells > 0 && scan.flags[azimuth] & flag::MEASURED != 0)
        {
            let bins = &scan.row(azimuth)[skipped * bins_a_cell..][..cells * bins_a_cell];
            let powers = &mut self.powers[azimuth * cells..][..cells];
            sum(
                bins,
                bins_a_cell,
                i16::from(floor) * bins_a_cell as i16,
                powers,
            );
            self.lit[azimuth] = powers.iter().fold(0, |any, power| any | power) != 0;
        }
    }

    /// Cells of an azimuth.
    pub fn cells(&self) -> usize {
        self.layout.cells
    }

    /// What a cell's power is to be divided by.
    pub fn bins_a_cell(&self) -> usize {
        self.layout.bins_a_cell
    }

    /// Powers of an azimuth's cells, nearest first, 0 where they are not above the floor; `None` where all are, or where
    /// the azimuth was not measured.
    pub fn lit(&self, azimuth: usize) -> Option<&[i16]> {
        let cells = self.layout.cells;
        self.lit[azimuth].then(|| &self.powers[azimuth * cells..][..cells])
    }

    /// Range of a cell's centre.
    pub fn centre_m(&self, cell: u32) -> f32 {
        let cell = self.layout.skipped as f32 + cell as f32;
        (cell + 0.5) * self.layout.cell_m + self.layout.range_offset_m
    }
}

/// Sums of the bins of each cell, less the floor.
fn sum(bins: &[u8], bins_a_cell: usize, floor: i16, powers: &mut [i16]) {
    match bins_a_cell {
        1 => sum_each(bins, floor, powers, |[bin]: [u8; 1]| i16::from(bin)),
        4 => sum_each(bins, floor, powers, sum_4),
        _ => {
            for (power, bins) in powers.iter_mut().zip(bins.chunks_exact(bins_a_cell)) {
                *power = (bins.iter().map(|&bin| i16::from(bin)).sum::<i16>() - floor).max(0);
            }
        }
    }
}

fn sum_each<const BINS: usize>(
    bins: &[u8],
    floor: i16,
    powers: &mut [i16],
    sum: impl Fn([u8; BINS]) -> i16,
) {
    for (power, bins) in powers.iter_mut().zip(bins.as_chunks::<BINS>().0) {
        *power = (sum(*bins) - floor).max(0);
    }
}

/// As arithmetic on a whole word, which compilers vectorise where they do not see through sums of bytes.
fn sum_4(bins: [u8; 4]) -> i16 {
    let word = u32::from_le_bytes(bins);
    let pairs = (word & 0x00ff_00ff) + ((word >> 8) & 0x00ff_00ff);
    (pairs + (pairs >> 16)) as i16 & 0x3ff
}
