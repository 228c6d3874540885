//! One sweep of the radar, in the sensor's own polar grid.
//!
//! The bytes live wherever the caller keeps them (usually shared memory): [`PolarScan`] borrows them for reading,
//! [`ScanSlot`] borrows them for a reader of files to fill.

mod check;

pub use check::ScanError;
use ndarray::{ArrayView2, ShapeBuilder};

/// Most azimuths in one sweep. Navtech's radars measure 400, some 800.
pub const MAX_AZIMUTHS: usize = 1024;

/// Which way the azimuths grow, seen from above.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sense {
    /// Ahead, right, behind, left: Navtech's sensors.
    Clockwise,
    /// Ahead, left, behind, right.
    CounterClockwise,
}

/// What an azimuth's flag byte says; several may hold.
pub mod flag {
    /// The row was measured (not filled in from its neighbours).
    pub const MEASURED: u8 = 1;
    /// The row was measured with a rising chirp (sensors that alternate; see [`CHIRP_KNOWN`]).
    pub const CHIRP_UP: u8 = 2;
    /// The sensor says which chirp each azimuth used, so that [`CHIRP_UP`] means something.
    pub const CHIRP_KNOWN: u8 = 4;
}

/// Where the powers lie in a scan's bytes, and what they measure.
///
/// The power of azimuth `a` at range bin `b` is byte `first_byte + a * stride + b`. Rows keep the bytes
/// that a file puts before each row (Oxford: 11), so that an image decodes in place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SweepGeometry {
    /// Rows: azimuths in this sweep.
    pub azimuths: usize,
    /// Columns: range bins of an azimuth.
    pub bins: usize,
    /// Bytes from one azimuth's first bin to the next azimuth's.
    pub stride: usize,
    /// The first azimuth's first bin.
    pub first_byte: usize,
    /// Metres a range bin.
    pub range_resolution_m: f32,
    /// Metres to add to a bin's range: bin `b`'s centre is at `(b + 0.5) * range_resolution_m + range_offset_m`.
    pub range_offset_m: f32,
    /// Metres to add to a range for each m/s at which the sensor approaches what it looks at (Doppler's shift of a chirp),
    /// 0 where it is not known. What approaches reads too near with a rising chirp, so this is positive there, and
    /// negative with a falling one; azimuths that say which chirp they used take their sign from that.
    pub doppler_s: f32,
    /// Which way the azimuths grow.
    pub sense: Sense,
    /// The scan's time, ns since 1970: the middle of the sweep on the sensor's clock, unless the reader says otherwise.
    pub stamp_ns: i64,
}

/// A scan to read: `azimuths x bins` powers with the angle and time of each azimuth.
#[derive(Clone, Copy, Debug)]
pub struct PolarScan<'a> {
    /// Where the powers lie and what they measure.
    pub geometry: SweepGeometry,
    /// All bytes of the scan.
    pub bytes: &'a [u8],
    /// Angle of each azimuth from straight ahead, radians in `[0, 2 pi)`, growing in `geometry.sense`, as the sensor measured it.
    pub azimuth_rad: &'a [f32],
    /// Time of each azimuth, ns since 1970, on the sensor's clock.
    pub stamp_ns: &'a [i64],
    /// What is known of each azimuth; see [`flag`].
    pub flags: &'a [u8],
}

impl<'a> PolarScan<'a> {
    /// The powers of one azimuth, nearest first.
    pub fn row(&self, azimuth: usize) -> &'a [u8] {
        let first = self.geometry.first_byte + azimuth * self.geometry.stride;
        &self.bytes[first..first + self.geometry.bins]
    }

    /// The powers, azimuth x range bin: a view of the scan's bytes that skips what lies between rows.
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

    /// Seconds from the scan's stamp to an azimuth's.
    pub fn time_s(&self, azimuth: usize) -> f64 {
        self.stamp_ns[azimuth].saturating_sub(self.geometry.stamp_ns) as f64 * 1e-9
    }

    /// [`SweepGeometry::doppler_s`] of one azimuth, its sign by the azimuth's chirp where that is known.
    pub fn doppler_s(&self, azimuth: usize) -> f32 {
        let shift_s = self.geometry.doppler_s;
        match self.flags[azimuth] & (flag::CHIRP_KNOWN | flag::CHIRP_UP) {
            0 | flag::CHIRP_UP => shift_s,
            flag::CHIRP_KNOWN => -shift_s.abs(),
            _ => shift_s.abs(),
        }
    }

    /// Range of a bin's centre in metres, Doppler's shift included; fractions of a bin are welcome.
    pub fn range_m(&self, bin: f32) -> f32 {
        (bin + 0.5) * self.geometry.range_resolution_m + self.geometry.range_offset_m
    }
}

/// Where a reader of files puts a scan. All slices are at least as long as the dataset's [`ScanLimits`] say.
#[derive(Debug)]
pub struct ScanSlot<'a> {
    /// For the image's bytes.
    pub bytes: &'a mut [u8],
    /// For the angle of each azimuth.
    pub azimuth_rad: &'a mut [f32],
    /// For the time of each azimuth.
    pub stamp_ns: &'a mut [i64],
    /// For each azimuth's flags.
    pub flags: &'a mut [u8],
}

/// The largest scan of a dataset: what memory to set aside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScanLimits {
    /// Bytes of the image.
    pub bytes: usize,
    /// Azimuths, at most [`MAX_AZIMUTHS`].
    pub azimuths: usize,
}

/// A scan in memory of its own: for tests, tools and generators.
#[derive(Clone, Debug)]
pub struct OwnedScan {
    /// Where the powers lie and what they measure.
    pub geometry: SweepGeometry,
    /// All bytes of the scan.
    pub bytes: Vec<u8>,
    /// See [`PolarScan::azimuth_rad`].
    pub azimuth_rad: Vec<f32>,
    /// See [`PolarScan::stamp_ns`].
    pub stamp_ns: Vec<i64>,
    /// See [`PolarScan::flags`].
    pub flags: Vec<u8>,
}

impl OwnedScan {
    /// An empty scan with room for `limits`; give its [`OwnedScan::slot`] to a reader and keep the geometry that comes back.
    pub fn with_limits(limits: ScanLimits) -> Self {
        Self {
            geometry: SweepGeometry {
                azimuths: 0,
                bins: 0,
                stride: 0,
                first_byte: 0,
                range_resolution_m: 0.0,
                range_offset_m: 0.0,
                doppler_s: 0.0,
                sense: Sense::Clockwise,
                stamp_ns: 0,
            },
            bytes: vec![0; limits.bytes],
            azimuth_rad: vec![0.0; limits.azimuths],
            stamp_ns: vec![0; limits.azimuths],
            flags: vec![0; limits.azimuths],
        }
    }

    /// The memory to fill.
    pub fn slot(&mut self) -> ScanSlot<'_> {
        ScanSlot {
            bytes: &mut self.bytes,
            azimuth_rad: &mut self.azimuth_rad,
            stamp_ns: &mut self.stamp_ns,
            flags: &mut self.flags,
        }
    }

    /// The scan, for reading.
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
