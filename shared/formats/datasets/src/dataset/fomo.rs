//! FoMo: `navtech/<us>.png`, metadata columns as in Oxford, of a Navtech RAS6.
//!
//! The encoder has 5600 counts per turn, and the ranges an offset of -0.32 m: fomo-sdk's converter
//! to bags (`fomo_rust/src/fomo_rust_sdk/sensors/radar.rs`) gives 5600 counts, and fomo-bench's
//! settings for teach and repeat (`cir_warthog_default_blue.yaml`) 5600 counts and -0.31991 m. Only
//! the Python kit says 5595 and no offset. Real rows decide: 400 with steps of 14 are 5600, from 7
//! to 5593, so that half a step remains at either end.

use super::detect::Found;
use super::error::OpenError;
use super::first_image::NamedBy;
use super::format::Format;
use super::navtech_png::ByteTen;
use super::navtech_profile::{Profile, ScanTime};
use super::navtech_scans::NavtechScans;
use super::options::{AzimuthSource, DatasetOptions};

/// Depth of a range bin, m.
pub const RANGE_RESOLUTION_M: f32 = 0.0438;
/// Offset of the ranges, m.
pub const RANGE_OFFSET_M: f32 = -0.32;
/// Encoder counts per turn.
pub const ENCODER_COUNTS: u16 = 5600;

const STAMPS: &str = "Files are named by the stamp of the first row; the time of a scan is the mean of its first and last row's stamps.";

pub(crate) fn open(found: Found, options: &DatasetOptions) -> Result<NavtechScans, OpenError> {
    NavtechScans::open(found, options, |_| Profile {
        format: Format::Fomo,
        range_resolution_m: RANGE_RESOLUTION_M,
        range_offset_m: RANGE_OFFSET_M,
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
