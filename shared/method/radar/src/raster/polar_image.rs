//! The polar image that cells are sampled from: power above the floor, averaged along range over
//! the depth of a cell. Its columns are finer than a cell but coarser than a bin, so that it stays
//! in the cache.

use gyre_geometry::scan::{PolarScan, SweepGeometry};

use super::{
    kernels::window::{self, Window},
    sweep_motion::SweepMotion,
};

/// Row-major samples, in units of 1/256 of the scan's power: one row per azimuth, the first one
/// repeated at the end, and empty columns on both sides. Bilinear sampling uses a window of one
/// bin.
#[derive(Debug)]
pub(super) struct PolarImage {
    window_m: f32,
    layout: Layout,
    pub samples: Vec<u16>,
    /// Piecewise sums of one azimuth, padded with zeros by the reach of the window.
    pieces: Vec<u16>,
    above_floor: Vec<u8>,
    /// Samples of one azimuth before Doppler compensation.
    measured: Vec<u16>,
}

#[derive(Clone, Debug, Default, PartialEq)]
struct Layout {
    azimuths: usize,
    bins: usize,
    range_resolution_m: f32,
    window: Window,
    pieces: usize,
}

impl Layout {
    fn new(geometry: &SweepGeometry, window_m: f32) -> Self {
        let window = Window::new(window_m / geometry.range_resolution_m);
        Self {
            azimuths: geometry.azimuths,
            bins: geometry.bins,
            range_resolution_m: geometry.range_resolution_m,
            pieces: geometry.bins.div_ceil(window.bins_per_piece),
            window,
        }
    }

    /// Columns before the first piece. The first of them is out of reach of the window, and so
    /// empty.
    fn lead(&self) -> usize {
        self.window.reach() + 1
    }

    fn stride(&self) -> usize {
        self.lead() + self.pieces + self.window.reach() + 2
    }

    fn piece_m(&self) -> f32 {
        self.range_resolution_m * self.window.bins_per_piece as f32
    }
}

impl PolarImage {
    /// `window_m` is the depth of the mean, m; less than a bin counts as one bin.
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

    /// Computes the image of a scan out to `max_range_m`; columns beyond are undefined. With a
    /// `motion` the Doppler shift is compensated azimuth by azimuth, so that rising and falling
    /// chirps may alternate.
    pub fn fill(
        &mut self,
        scan: &PolarScan<'_>,
        floor: u8,
        max_range_m: f32,
        motion: Option<&SweepMotion>,
    ) {
        self.lay_out(&scan.geometry);
        let motion = motion.filter(|_| scan.geometry.doppler_s != 0.0);
        let max_shift_m = motion.map_or(0.0, |motion| {
            motion.speed_mps() * scan.geometry.doppler_s.abs()
        });
        let layout = &self.layout;
        let (stride, reach) = (layout.stride(), layout.window.reach());
        let place = (max_range_m + max_shift_m - scan.geometry.range_offset_m) / layout.piece_m();
        let columns = stride.min((place.max(0.0) as usize).saturating_add(layout.lead() + 3));
        let pieces = layout.pieces.min(columns + reach);
        let bins = layout.bins.min(pieces * layout.window.bins_per_piece);
        let first = layout.lead() + reach;
        for azimuth in 0..layout.azimuths {
            let powers = &scan.row(azimuth)[..bins];
            let above_floor = &mut self.above_floor[..bins];
            window::subtract_floor(powers, floor, above_floor);
            let sums = &mut self.pieces[first..first + pieces];
            window::sum_pieces(above_floor, layout.window.bins_per_piece, sums);
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
        let stride = layout.stride();
        self.layout.azimuths = layout.azimuths;
        if layout != self.layout {
            self.samples.clear();
            self.pieces.clear();
            self.pieces.resize(stride + 2 * layout.window.reach(), 0);
            self.above_floor.resize(layout.bins, 0);
            self.measured.resize(stride, 0);
        }
        self.samples.resize((layout.azimuths + 1) * stride, 0);
        self.layout = layout;
    }

    pub fn stride(&self) -> usize {
        self.layout.stride()
    }

    pub fn columns_per_metre(&self) -> f32 {
        1.0 / self.layout.piece_m()
    }

    pub fn column_at_sensor(&self, range_offset_m: f32) -> f32 {
        self.layout.lead() as f32 - 0.5 - range_offset_m / self.layout.piece_m()
    }
}
