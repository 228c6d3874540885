//! The parameters in which the formats with Navtech metadata columns differ.

use super::first_image::NamedBy;
use super::format::Format;
use super::navtech_png::ByteTen;
use super::options::{AzimuthSource, DatasetOptions};

/// The definition of the time of a scan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ScanTime {
    /// The mean of the first and last row's stamps.
    Halfway,
    /// The stamp of row `n / 2 - 1`.
    MiddleRow,
}

impl ScanTime {
    /// The definition of the stamps where files are not named by them.
    pub(crate) fn of_rows(self) -> &'static str {
        match self {
            Self::Halfway => {
                "Rows have stamps; the time of a scan is the mean of its first and last row's stamps."
            }
            Self::MiddleRow => "Rows have stamps; the time of a scan is that of row n/2 - 1.",
        }
    }
}

/// The parameters of a format.
#[derive(Clone, Debug)]
pub(crate) struct Profile {
    pub(crate) format: Format,
    pub(crate) range_resolution_m: f32,
    pub(crate) range_offset_m: f32,
    pub(crate) doppler_s: f32,
    pub(crate) azimuth_eccentricity_rad: f32,
    pub(crate) encoder_counts: u16,
    pub(crate) azimuth_source: AzimuthSource,
    pub(crate) scan_time: ScanTime,
    /// True if row stamps come in bursts, and are replaced by a linear fit over the azimuth.
    pub(crate) smooth_stamps: bool,
    pub(crate) byte_ten: ByteTen,
    pub(crate) named_by: NamedBy,
    pub(crate) stamp_meaning: &'static str,
}

impl Profile {
    pub(crate) fn with(mut self, options: &DatasetOptions) -> Self {
        self.range_resolution_m = options
            .range_resolution_m
            .unwrap_or(self.range_resolution_m);
        self.range_offset_m = options.range_offset_m.unwrap_or(self.range_offset_m);
        self.doppler_s = options.doppler_s.unwrap_or(self.doppler_s);
        self.azimuth_eccentricity_rad = options
            .azimuth_eccentricity_rad
            .unwrap_or(self.azimuth_eccentricity_rad);
        self.encoder_counts = options.encoder_counts.unwrap_or(self.encoder_counts);
        self.azimuth_source = options.azimuth_source.unwrap_or(self.azimuth_source);
        self
    }
}
