//! The scan as it is sampled: power above the floor, averaged along range over what a cell covers, in steps of range
//! that are fine beside a cell but coarse beside a bin, so that the cells' reads stay in the cache.

use super::kernels::window::{self, Window};
use super::sweep_motion::SweepMotion;
use crate::scan::{PolarScan, SweepGeometry};

/// Row-major samples, in units of 1/256 of the scan's power: one row an azimuth and the first one again at the end,
/// with empty columns at both sides. Bilinear sampling is the same with a window of one bin.
#[derive(Debug)]
pub(super) struct PolarImage {
    window_m: f32,
    layout: Layout,
    samples: Vec<u16>,
    /// One azimuth's sums of bins, with as many empty ones around them as the windows reach over.
    pieces: Vec<u16>,
    /// One azimuth's powers above the floor.
    above_floor: Vec<u8>,
    /// One azimuth's samples at the ranges as measured, while Doppler's shift is undone.
    measured: Vec<u16>,
}

/// What follows from the scan's geometry.
#[derive(Clone, Debug, Default, PartialEq)]
struct Layout {
    azimuths: usize,
    bins: usize,
    range_resolution_m: f32,
    window: Window,
    /// Pieces of an azimuth.
    pieces: usize,
}

impl Layout {
    fn new(geometry: &SweepGeometry, window_m: f32) -> Self {
        let window = Window::new(window_m / geometry.range_resolution_m);
        Self {
            azimuths: geometry.azimuths,
            bins: geometry.bins,
            range_resolution_m: geometry.range_resolution_m,
            pieces: geometry.bins.div_ceil(window.bins_a_piece),
            window,
        }
    }

    /// Columns before the first piece. The first of them is empty: no window reaches further.
    fn lead(&self) -> usize {
        self.window.reach() + 1
    }

    /// Columns, the last two empty.
    fn stride(&self) -> usize {
        self.lead() + self.pieces + self.window.reach() + 2
    }

    fn piece_m(&self) -> f32 {
        self.range_resolution_m * self.window.bins_a_piece as f32
    }
}

impl PolarImage {
    /// `window_m`: metres of range that a sample is the mean of; less than a bin counts as one bin.
    pub fn new(window_m: f32) -> Self {
        Self {
            window_m,
            layout: Layout::default(),
            samples: Vec::new(),
            pieces: Vec::new(),
            above_floor: Vec::new(),
            measured: Vec::new(),
        }
    }

    /// Takes the scan's powers out to `furthest_m`; columns beyond hold nothing of use. With a `motion` the columns are
    /// true ranges, Doppler's shift undone azimuth by azimuth, so that rising and falling chirps may alternate.
    pub fn fill(
        &mut self,
        scan: &PolarScan<'_>,
        floor: u8,
        furthest_m: f32,
        motion: Option<&SweepMotion>,
    ) {
        self.lay_out(&scan.geometry);
        let motion = motion.filter(|_| scan.geometry.doppler_s != 0.0);
        let most_m = motion.map_or(0.0, |motion| {
            motion.speed_mps() * scan.geometry.doppler_s.abs()
        });
        let layout = &self.layout;
        let (stride, reach) = (layout.stride(), layout.window.reach());
        let place = (furthest_m + most_m - scan.geometry.range_offset_m) / layout.piece_m();
        let columns = stride.min((place.max(0.0) as usize).saturating_add(layout.lead() + 3));
        let pieces = layout.pieces.min(columns + reach);
        let bins = layout.bins.min(pieces * layout.window.bins_a_piece);
        let first = layout.lead() + reach;
        for azimuth in 0..layout.azimuths {
            let powers = &scan.row(azimuth)[..bins];
            let sums = &mut self.pieces[first..first + pieces];
            window::sum_pieces(
                powers,
                floor,
                layout.window.bins_a_piece,
                &mut self.above_floor,
                sums,
            );
            let row = &mut self.samples[azimuth * stride..][..stride];
            let Some(motion) = motion else {
                window::average(&self.pieces, &layout.window, &mut row[..columns]);
                continue;
            };
            let measured = &mut self.measured[..columns];
            window::average(&self.pieces, &layout.window, measured);
            let shift_m = scan.doppler_s(azimuth) * motion.approach_mps(scan.azimuth_rad[azimuth]);
            window::shift(measured, shift_m / layout.piece_m(), &mut row[..columns]);
            row[0] = 0;
            row[stride - 2..].fill(0);
        }
        self.samples
            .copy_within(..columns, layout.azimuths * stride);
    }

    fn lay_out(&mut self, geometry: &SweepGeometry) {
        let layout = Layout::new(geometry, self.window_m);
        if layout == self.layout {
            return;
        }
        let stride = layout.stride();
        self.samples.clear();
        self.samples.resize((layout.azimuths + 1) * stride, 0);
        self.pieces.clear();
        self.pieces.resize(stride + 2 * layout.window.reach(), 0);
        self.above_floor.resize(layout.bins, 0);
        self.measured.resize(stride, 0);
        self.layout = layout;
    }

    pub fn samples(&self) -> &[u16] {
        &self.samples
    }

    pub fn stride(&self) -> usize {
        self.layout.stride()
    }

    pub fn columns_a_metre(&self) -> f32 {
        1.0 / self.layout.piece_m()
    }

    /// The fractional column of what lies `range_offset_m` before the first bin's start.
    pub fn column_at_sensor(&self, range_offset_m: f32) -> f32 {
        self.layout.lead() as f32 - 0.5 - range_offset_m / self.layout.piece_m()
    }
}
