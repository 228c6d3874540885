//! Range cells: sums of a whole number of bins, less the floor.

use super::PointsConfig;
use crate::scan::{PolarScan, flag};

/// Maximum number of bins per cell: the sum must fit an i16, which every vector unit can compare.
const MAX_BINS_PER_CELL: usize = 128;

/// Maximum power of a cell.
pub(super) const MAX_POWER: usize = MAX_BINS_PER_CELL * 255;

/// Powers of the cells between minimum and maximum range: sums over the bins of a cell.
#[derive(Debug, Default)]
pub(super) struct RangeCells {
    layout: Layout,
    /// Row-major, one row per azimuth.
    powers: Vec<i16>,
    /// True if each azimuth was measured and has a power above the floor.
    active: Vec<bool>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Layout {
    bins_per_cell: usize,
    /// Cells below the minimum range.
    skipped: usize,
    /// Cells per azimuth between minimum and maximum range.
    cells: usize,
    cell_m: f32,
    range_offset_m: f32,
}

impl Layout {
    fn new(scan: &PolarScan<'_>, config: &PointsConfig) -> Self {
        let geometry = &scan.geometry;
        let bins_per_cell = (config.range_cell_m / geometry.range_resolution_m).round() as usize;
        let bins_per_cell = bins_per_cell.clamp(1, MAX_BINS_PER_CELL);
        let cell_m = geometry.range_resolution_m * bins_per_cell as f32;
        let place = |range_m: f32| (range_m - geometry.range_offset_m) / cell_m - 0.5;
        let skipped = place(config.min_range_m).ceil().max(0.0) as usize;
        let end = ((place(config.max_range_m) + 1.0).floor().max(0.0) as usize)
            .min(geometry.bins / bins_per_cell);
        let cells = end.saturating_sub(skipped);
        Self {
            bins_per_cell,
            skipped,
            cells,
            cell_m,
            range_offset_m: geometry.range_offset_m,
        }
    }
}

impl RangeCells {
    pub fn update(&mut self, scan: &PolarScan<'_>, floor: u8, config: &PointsConfig) {
        self.layout = Layout::new(scan, config);
        let (
            azimuths,
            Layout {
                bins_per_cell,
                skipped,
                cells,
                ..
            },
        ) = (scan.geometry.azimuths, self.layout);
        self.powers.resize(azimuths * cells, 0);
        self.active.clear();
        self.active.resize(azimuths, false);
        for azimuth in
            (0..azimuths).filter(|&azimuth| cells > 0 && scan.flags[azimuth] & flag::MEASURED != 0)
        {
            let bins = &scan.row(azimuth)[skipped * bins_per_cell..][..cells * bins_per_cell];
            let powers = &mut self.powers[azimuth * cells..][..cells];
            sum(
                bins,
                bins_per_cell,
                i16::from(floor) * bins_per_cell as i16,
                powers,
            );
            self.active[azimuth] = powers.iter().fold(0, |any, power| any | power) != 0;
        }
    }

    pub fn cells(&self) -> usize {
        self.layout.cells
    }

    /// Bins per cell, the divisor from a sum to a mean power.
    pub fn bins_per_cell(&self) -> usize {
        self.layout.bins_per_cell
    }

    /// Powers of the cells of an azimuth, nearest first, 0 where not above the floor. `None` where
    /// all are 0, or where the azimuth was not measured.
    pub fn powers(&self, azimuth: usize) -> Option<&[i16]> {
        let cells = self.layout.cells;
        self.active[azimuth].then(|| &self.powers[azimuth * cells..][..cells])
    }

    /// Range of the centre of a cell, m.
    pub fn centre_m(&self, cell: u32) -> f32 {
        let cell = self.layout.skipped as f32 + cell as f32;
        (cell + 0.5) * self.layout.cell_m + self.layout.range_offset_m
    }
}

/// Writes the sums of the bins of each cell, less the floor.
fn sum(bins: &[u8], bins_per_cell: usize, floor: i16, powers: &mut [i16]) {
    match bins_per_cell {
        1 => sum_each(bins, floor, powers, |[bin]: [u8; 1]| i16::from(bin)),
        4 => sum_each(bins, floor, powers, sum_4),
        _ => {
            for (power, bins) in powers.iter_mut().zip(bins.chunks_exact(bins_per_cell)) {
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

/// Arithmetic on words, which compilers vectorise better than sums of bytes.
fn sum_4(bins: [u8; 4]) -> i16 {
    let word = u32::from_le_bytes(bins);
    let pairs = (word & 0x00ff_00ff) + ((word >> 8) & 0x00ff_00ff);
    (pairs + (pairs >> 16)) as i16 & 0x3ff
}
