//! Range cells: sums of a whole number of bins, less the floor.

use super::PointsConfig;
use crate::raster::kernels::window::sum_pieces;
use gyre_geometry::scan::{PolarScan, flag};

/// Maximum number of bins per cell: the sum must fit an i16, which every vector unit can compare.
const MAX_BINS_PER_CELL: usize = 128;

pub(super) const MAX_POWER: usize = MAX_BINS_PER_CELL * 255;

/// Powers of the cells between minimum and maximum range: sums over the bins of a cell.
#[derive(Debug, Default)]
pub(super) struct RangeCells {
    pub layout: Layout,
    /// Row-major, one row per azimuth.
    powers: Vec<i16>,
    sums: Vec<u16>,
    /// True if each azimuth was measured and has a power above the floor.
    active: Vec<bool>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Layout {
    pub bins_per_cell: usize,
    skipped: usize,
    pub cells: usize,
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
        let Layout {
            bins_per_cell,
            skipped,
            cells,
            ..
        } = self.layout;
        let azimuths = scan.geometry.azimuths;
        let floor = i16::from(floor) * bins_per_cell as i16;
        self.powers.resize(azimuths * cells, 0);
        self.sums.resize(cells, 0);
        self.active.clear();
        self.active.resize(azimuths, false);
        let measured = |azimuth: &usize| scan.flags[*azimuth] & flag::MEASURED != 0;
        for azimuth in (0..azimuths).filter(|it| cells > 0 && measured(it)) {
            let bins = &scan.row(azimuth)[skipped * bins_per_cell..][..cells * bins_per_cell];
            sum_pieces(bins, bins_per_cell, &mut self.sums);
            let powers = &mut self.powers[azimuth * cells..][..cells];
            for (power, sum) in powers.iter_mut().zip(&self.sums) {
                *power = (*sum as i16 - floor).max(0);
            }
            self.active[azimuth] = powers.iter().fold(0, |any, power| any | power) != 0;
        }
    }

    /// Powers of the cells of an azimuth, nearest first, 0 where not above the floor. `None` where
    /// all are 0, or where the azimuth was not measured.
    pub fn powers(&self, azimuth: usize) -> Option<&[i16]> {
        let cells = self.layout.cells;
        self.active[azimuth].then(|| &self.powers[azimuth * cells..][..cells])
    }

    pub fn centre_m(&self, cell: u32) -> f32 {
        let cell = self.layout.skipped as f32 + cell as f32;
        (cell + 0.5) * self.layout.cell_m + self.layout.range_offset_m
    }
}
