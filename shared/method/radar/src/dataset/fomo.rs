//! FoMo: `navtech/<us>.png`, metadata columns as in Oxford, an encoder of 5595 counts by its
//! development kit.

use super::detect::Found;
use super::error::OpenError;
use super::first_image::NamedBy;
use super::format::Format;
use super::navtech_png::ByteTen;
use super::navtech_scans::{NavtechScans, Profile, ScanTime};
use super::options::{AzimuthSource, DatasetOptions};

/// Depth of a range bin, m.
pub const RANGE_RESOLUTION_M: f32 = 0.0438;
/// Encoder counts per turn.
pub const ENCODER_COUNTS: u16 = 5595;

const STAMPS: &str = "Files are named by the stamp of the first row; the time of a scan is the mean of its first and last row's stamps.";

pub(crate) fn open(found: Found, options: &DatasetOptions) -> Result<NavtechScans, OpenError> {
    NavtechScans::open(found, options, |_| Profile {
        format: Format::Fomo,
        range_resolution_m: RANGE_RESOLUTION_M,
        range_offset_m: 0.0,
        doppler_s: 0.0,
        azimuth_eccentricity_rad: 0.0,
        encoder_counts: ENCODER_COUNTS,
        azimuth_source: AzimuthSource::Encoder,
        scan_time: ScanTime::Halfway,
        smooth_stamps: false,
        byte_ten: ByteTen::Unused,
        named_by: NamedBy::Start,
        stamp_meaning: STAMPS,
    })
}
