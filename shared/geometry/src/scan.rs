//! One sweep of the radar in the sensor's polar grid.
//!
//! The caller owns the memory (usually shared memory): [`PolarScan`] borrows it for reading,
//! [`ScanSlot`] borrows it for a dataset reader to fill.

mod check;

pub use check::ScanError;
pub use check::check_sweep;
use ndarray::{ArrayView2, ShapeBuilder};

/// The largest number of azimuths in a sweep. Navtech radars measure 400, some 800.
pub const MAX_AZIMUTHS: usize = 1024;

/// The direction of increasing azimuths, seen from above.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sense {
    /// Ahead, right, behind, left: Navtech sensors.
    #[default]
    Clockwise,
    /// Ahead, left, behind, right.
    CounterClockwise,
}

pub mod flag {
    /// The azimuth was measured, not interpolated from its neighbours.
    pub const MEASURED: u8 = 1;
    /// The azimuth was measured with a rising chirp; valid only with [`CHIRP_KNOWN`].
    pub const CHIRP_UP: u8 = 2;
    /// The sensor reports the chirp of each azimuth in [`CHIRP_UP`].
    pub const CHIRP_KNOWN: u8 = 4;
    /// The row still holds the powers of the turn before, since that many azimuths of this turn
    /// were lost before it, at unknown places: see [`crate::lost`]. It is not [`MEASURED`].
    pub const STALE: u8 = 8;
    /// The angle assumes a uniform turn without lost azimuths; it was not measured.
    pub const ASSUMED: u8 = 16;
}

/// The layout of the powers in the bytes of a scan, and their scale.
///
/// The power of azimuth `a` at range bin `b` is byte `first_byte + a * stride + b`. Rows keep the
/// metadata bytes that a file stores before each row (Oxford: 11), so that an image decodes in
/// place.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SweepGeometry {
    pub azimuths: usize,
    pub bins: usize,
    pub stride: usize,
    pub first_byte: usize,
    pub range_resolution_m: f32,
    /// Offset of the ranges, m: the centre of bin `b` is at
    /// `(b + 0.5) * range_resolution_m + range_offset_m`.
    pub range_offset_m: f32,
    /// Doppler coefficient, s: metres to add to a range for each m/s of closing speed; 0 if
    /// unknown. With a rising chirp an approaching target appears too near, so the coefficient is
    /// positive, and with a falling chirp negative. Where the chirp of an azimuth is known, it
    /// determines the sign.
    pub doppler_s: f32,
    pub sense: Sense,
    /// Time of the scan, ns since 1970: the middle of the sweep on the sensor's clock, unless the
    /// reader documents otherwise.
    pub stamp_ns: i64,
}

/// A borrowed scan: `azimuths x bins` powers, with the angle and time of each azimuth.
#[derive(Clone, Copy, Debug)]
pub struct PolarScan<'a> {
    pub geometry: SweepGeometry,
    pub bytes: &'a [u8],
    /// Measured angle of each azimuth from straight ahead, rad in `[0, 2 pi)`, increasing in the
    /// direction of `geometry.sense`.
    pub azimuth_rad: &'a [f32],
    /// Time of each azimuth, ns since 1970, on the sensor's clock.
    pub stamp_ns: &'a [i64],
    pub flags: &'a [u8],
}

impl<'a> PolarScan<'a> {
    pub fn row(&self, azimuth: usize) -> &'a [u8] {
        let first = self.geometry.first_byte + azimuth * self.geometry.stride;
        &self.bytes[first..first + self.geometry.bins]
    }

    /// Returns the powers, azimuth x range bin: a strided view of the bytes, without the metadata
    /// between rows.
    ///
    /// # Panics
    /// If the scan does not pass [`PolarScan::check`].
    pub fn power(&self) -> ArrayView2<'a, u8> {
        let SweepGeometry {
            azimuths,
            bins,
            stride,
            first_byte,
            ..
        } = self.geometry;
        let shape = (azimuths, bins).strides((stride, 1));
        let bytes = self.bytes.get(first_byte..).unwrap_or_default();
        ArrayView2::from_shape(shape, bytes).expect("the scan passes its check")
    }

    /// Time of an azimuth relative to the scan's stamp, s.
    pub fn time_s(&self, azimuth: usize) -> f64 {
        self.stamp_ns[azimuth].saturating_sub(self.geometry.stamp_ns) as f64 * 1e-9
    }

    /// Times of the first and of the last azimuth, ns since 1970; the stamp twice without azimuths.
    pub fn span_ns(&self) -> [i64; 2] {
        let stamps = self.stamp_ns.iter().copied();
        let or_stamp = |ns: Option<i64>| ns.unwrap_or(self.geometry.stamp_ns);
        [or_stamp(stamps.clone().min()), or_stamp(stamps.max())]
    }

    /// Doppler coefficient of one azimuth, s: [`SweepGeometry::doppler_s`] with the sign of the
    /// azimuth's chirp where it is known.
    pub fn doppler_s(&self, azimuth: usize) -> f32 {
        let shift_s = self.geometry.doppler_s;
        match self.flags[azimuth] & (flag::CHIRP_KNOWN | flag::CHIRP_UP) {
            0 | flag::CHIRP_UP => shift_s,
            flag::CHIRP_KNOWN => -shift_s.abs(),
            _ => shift_s.abs(),
        }
    }

    /// Range of the centre of a bin as measured (no Doppler compensation), m. Accepts fractional
    /// bins.
    pub fn range_m(&self, bin: f32) -> f32 {
        (bin + 0.5) * self.geometry.range_resolution_m + self.geometry.range_offset_m
    }
}

/// Memory that a dataset reader fills with a scan. Each slice is at least as long as the dataset's
/// [`ScanLimits`].
#[derive(Debug)]
pub struct ScanSlot<'a> {
    pub bytes: &'a mut [u8],
    pub azimuth_rad: &'a mut [f32],
    pub stamp_ns: &'a mut [i64],
    pub flags: &'a mut [u8],
}

/// The size of the largest scan of a dataset, for allocation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScanLimits {
    pub bytes: usize,
    pub azimuths: usize,
}

/// A scan that owns its memory: for tests, tools and generators.
#[derive(Clone, Debug)]
pub struct OwnedScan {
    pub geometry: SweepGeometry,
    pub bytes: Vec<u8>,
    pub azimuth_rad: Vec<f32>,
    pub stamp_ns: Vec<i64>,
    pub flags: Vec<u8>,
}

impl OwnedScan {
    /// Returns an empty scan with the capacity `limits`. Pass its [`OwnedScan::slot`] to a reader,
    /// and assign the geometry that the reader returns.
    pub fn with_limits(limits: ScanLimits) -> Self {
        Self {
            geometry: SweepGeometry::default(),
            bytes: vec![0; limits.bytes],
            azimuth_rad: vec![0.0; limits.azimuths],
            stamp_ns: vec![0; limits.azimuths],
            flags: vec![0; limits.azimuths],
        }
    }

    /// Returns a scan of this geometry without power, whose azimuths are all measured.
    pub fn of(geometry: SweepGeometry) -> Self {
        let azimuths = geometry.azimuths;
        let bytes = azimuths * geometry.stride;
        let mut scan = Self::with_limits(ScanLimits { bytes, azimuths });
        (scan.geometry, scan.flags) = (geometry, vec![flag::MEASURED; azimuths]);
        scan
    }

    pub fn slot(&mut self) -> ScanSlot<'_> {
        ScanSlot {
            bytes: &mut self.bytes,
            azimuth_rad: &mut self.azimuth_rad,
            stamp_ns: &mut self.stamp_ns,
            flags: &mut self.flags,
        }
    }

    pub fn view(&self) -> PolarScan<'_> {
        let azimuths = self.geometry.azimuths;
        PolarScan {
            geometry: self.geometry,
            bytes: &self.bytes,
            azimuth_rad: &self.azimuth_rad[..azimuths],
            stamp_ns: &self.stamp_ns[..azimuths],
            flags: &self.flags[..azimuths],
        }
    }
}
