//! MulRan: `sensor_data/radar/polar/<ns>.png` as recorded (3360 rows of range x 400 columns of azimuth, no metadata), or
//! converted to the format of Oxford in `polar_oxford_form/<ns>.png` with stamps in ns. Named by the end of the sweep.

use std::path::Path;

use super::Dataset;
use super::detect::Found;
use super::error::{OpenError, ReadError};
use super::first_image::NamedBy;
use super::format::Format;
use super::image_size::ImageSize;
use super::navtech_png::ByteTen;
use super::navtech_scans::{NavtechScans, Profile, ScanTime};
use super::options::{AzimuthSource, DatasetOptions};
use super::stamp;
use super::transposed::{TransposedScans, mean_after_start_ns};
use crate::scan::{ScanLimits, ScanSlot, SweepGeometry};

/// Depth of a range bin, m: 200 m over 3360 bins.
pub const RANGE_RESOLUTION_M: f32 = 200.0 / 3360.0;

const STAMPS: &str = "Files are named by the end of the sweep; the time of a scan is half a turn earlier, where a turn is the time \
                      since the previous file, and columns are spread uniformly over the turn.";
const ROW_STAMPS: &str = "Files are named by the end of the sweep; the time of a scan is the mean of its first and last row's stamps.";

pub(crate) fn open_oxford_form(
    found: Found,
    options: &DatasetOptions,
) -> Result<NavtechScans, OpenError> {
    NavtechScans::open(found, options, |_| Profile {
        format: Format::MulranOxfordForm,
        range_resolution_m: RANGE_RESOLUTION_M,
        range_offset_m: 0.0,
        doppler_s: 0.0,
        azimuth_eccentricity_rad: 0.0,
        encoder_counts: 5600,
        azimuth_source: AzimuthSource::Encoder,
        scan_time: ScanTime::Halfway,
        smooth_stamps: false,
        byte_ten: ByteTen::Unused,
        named_by: NamedBy::End,
        stamp_meaning: ROW_STAMPS,
    })
}

/// MulRan scans as recorded.
#[derive(Debug)]
pub(crate) struct MulranPolar {
    scans: TransposedScans,
    end_ns: Vec<i64>,
    period_ns: i64,
    notes: Vec<String>,
}

impl MulranPolar {
    pub(crate) fn open(found: Found, options: &DatasetOptions) -> Result<Self, OpenError> {
        let (scans, notes) = TransposedScans::open(found, options, |_| RANGE_RESOLUTION_M)?;
        let end_ns = (0..scans.images.len())
            .map(|index| end_ns(&scans, index))
            .collect::<Result<Vec<_>, _>>()?;
        let period_ns = stamp::median_interval_ns(end_ns.iter().copied());
        Ok(Self {
            scans,
            end_ns,
            period_ns,
            notes,
        })
    }

    /// Start and duration of the turn of a scan, ns.
    fn turn_ns(&self, index: usize) -> Option<(i64, i64)> {
        let end = *self.end_ns.get(index)?;
        let since = index.checked_sub(1).map(|before| end - self.end_ns[before]);
        let period = since
            .filter(|ns| (ns - self.period_ns).abs() < self.period_ns / 5)
            .unwrap_or(self.period_ns);
        Some((end - period, period))
    }
}

fn end_ns(scans: &TransposedScans, index: usize) -> Result<i64, OpenError> {
    scans
        .images
        .name_stamp_ns(index)
        .ok_or_else(|| OpenError::UnknownLayout {
            path: scans.images.file(index).to_owned(),
            reason: "a MulRan image is named by its time in ns, of the years 2015 to 2040"
                .to_owned(),
        })
}

impl Dataset for MulranPolar {
    fn format(&self) -> Format {
        Format::Mulran
    }

    fn len(&self) -> usize {
        self.scans.images.len()
    }

    fn limits(&self) -> ScanLimits {
        self.scans.limits()
    }

    fn image_size(&self) -> ImageSize {
        self.scans.images.size
    }

    fn is_transposed(&self) -> bool {
        self.scans.is_transposed()
    }

    fn file(&self, index: usize) -> &Path {
        self.scans.images.file(index)
    }

    fn nominal_stamp_ns(&self, index: usize) -> Option<i64> {
        self.turn_ns(index)
            .map(|(start, period)| start + mean_after_start_ns(period, self.scans.azimuths()))
    }

    fn logged_stamp_ns(&self, index: usize) -> Option<i64> {
        self.end_ns.get(index).copied()
    }

    fn stamp_meaning(&self) -> &'static str {
        STAMPS
    }

    fn encoder_counts(&self) -> Option<u16> {
        None
    }

    fn notes(&self) -> &[String] {
        &self.notes
    }

    fn read(&mut self, index: usize, slot: ScanSlot<'_>) -> Result<SweepGeometry, ReadError> {
        let (start_ns, period_ns) = self.turn_ns(index).ok_or(ReadError::NoSuchScan {
            index,
            len: self.len(),
        })?;
        self.scans.read(index, slot, start_ns, period_ns)
    }
}
