//! The powers of a scan above its noise, in cells deep enough that the fastest vehicle shifts
//! echoes by [`REACH`] of them.

use crate::raster::kernels::window::sum_pieces;
use gyre_geometry::scan::PolarScan;

/// Largest shift of echoes in cells, either way.
pub(super) const REACH: usize = 31;
/// Shifts of both ways and none, rounded up to whole vectors.
pub(super) const WIDTH: usize = 64;
const MAX_SPEED_MPS: f32 = 40.0;
const MAX_RANGE_M: f32 = 100.0;
/// Least power of an echo above the median of all powers, in steps of half a decibel: noise, whose
/// power is distributed exponentially, exceeds its median by 10 dB once in a thousand bins.
const ABOVE_MEDIAN: u8 = 20;
/// Every so-many-th row and bin of the scan is enough for the median. Odd, so that rows are of both
/// chirps.
const MEDIAN_STEP: usize = 5;

/// Nearer echoes are of the radar itself: its ringing, m.
const RINGING_M: f32 = 2.5;

/// The cells of all rows. Each row has some cells before and behind it, only for its neighbours: if
/// all ended at one range, a wall there would seem to stand still.
#[derive(Debug, Default)]
pub(super) struct Rows {
    pub layout: Layout,
    powers: Vec<f32>,
    sums: Vec<u16>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Layout {
    bins_per_cell: usize,
    first_bin: usize,
    cells: usize,
    /// Cells before and behind it that are not empty.
    beside: [usize; 2],
    pub cell_m: f32,
}

impl Layout {
    fn of(scan: &PolarScan<'_>, min_range_m: f32) -> Self {
        let geometry = &scan.geometry;
        let shift_m = 2.0 * geometry.doppler_s.abs() * MAX_SPEED_MPS;
        let bins = (shift_m / REACH as f32 / geometry.range_resolution_m).round();
        let bins_per_cell = (bins as usize).clamp(1, 255);
        let bin_at = |range_m: f32| {
            let bin = (range_m - geometry.range_offset_m) / geometry.range_resolution_m;
            (bin.max(0.0) as usize).min(geometry.bins)
        };
        let (first_bin, end) = (bin_at(min_range_m), bin_at(MAX_RANGE_M));
        let cells = end.saturating_sub(first_bin) / bins_per_cell;
        let before = first_bin.saturating_sub(bin_at(RINGING_M)) / bins_per_cell;
        let behind = (geometry.bins - first_bin) / bins_per_cell - cells;
        Self {
            bins_per_cell,
            first_bin,
            cells,
            beside: [before.min(REACH), behind.min(WIDTH - REACH)],
            cell_m: bins_per_cell as f32 * geometry.range_resolution_m,
        }
    }

    fn stride(&self) -> usize {
        self.cells + WIDTH
    }
}

impl Rows {
    pub fn update(&mut self, scan: &PolarScan<'_>, min_range_m: f32) {
        let layout = Layout::of(scan, min_range_m);
        let (azimuths, stride) = (scan.geometry.azimuths, layout.stride());
        if (layout, azimuths * stride) != (self.layout, self.powers.len()) {
            self.layout = layout;
            self.powers.clear();
            self.powers.resize(azimuths * stride, 0.0);
        }
        let [before, behind] = layout.beside;
        let first_bin = layout.first_bin - before * layout.bins_per_cell;
        let all = before + layout.cells + behind;
        let bins = first_bin..first_bin + all * layout.bins_per_cell;
        let floor = median(scan, bins.clone()).saturating_add(ABOVE_MEDIAN);
        let floor = u16::from(floor) * layout.bins_per_cell as u16;
        self.sums.resize(all, 0);
        for (azimuth, powers) in self.powers.chunks_exact_mut(stride).enumerate() {
            let row = &scan.row(azimuth)[bins.clone()];
            sum_pieces(row, layout.bins_per_cell, &mut self.sums);
            let cells = &mut powers[REACH - before..REACH - before + all];
            for (cell, sum) in cells.iter_mut().zip(&self.sums) {
                *cell = f32::from(sum.saturating_sub(floor));
            }
        }
    }

    pub fn row(&self, azimuth: usize) -> &[f32] {
        &self.padded(azimuth)[REACH..REACH + self.layout.cells]
    }

    /// Returns the cells of a row with `REACH` more before them, and as many behind them as make
    /// [`WIDTH`].
    pub fn padded(&self, azimuth: usize) -> &[f32] {
        let stride = self.layout.stride();
        &self.powers[azimuth * stride..(azimuth + 1) * stride]
    }
}

fn median(scan: &PolarScan<'_>, bins: std::ops::Range<usize>) -> u8 {
    let mut counts = [0_u32; 256];
    for azimuth in (0..scan.geometry.azimuths).step_by(MEDIAN_STEP) {
        let powers = &scan.row(azimuth)[bins.clone()];
        for power in powers.iter().step_by(MEDIAN_STEP) {
            counts[usize::from(*power)] += 1;
        }
    }
    let half = counts.iter().sum::<u32>() / 2;
    let mut below = 0;
    let reaches_half = counts.iter().position(|count| {
        below += count;
        below > half
    });
    reaches_half.unwrap_or(0) as u8
}
