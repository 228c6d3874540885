//! Oxford Radar RobotCar, and the Oxford Offroad dataset (OORD), which uses its format.
//!
//! `radar/<us>.png`, 400 azimuths x (11 + 3768), named by the start of the sweep; azimuths
//! clockwise from ahead. OORD stores the images in `Navtech_CTS350-X_Radar/`, and its encoder
//! columns are unreliable.

use super::detect::Found;
use super::error::OpenError;
use super::first_image::NamedBy;
use super::format::Format;
use super::navtech_png::ByteTen;
use super::navtech_profile::{Profile, ScanTime};
use super::navtech_scans::NavtechScans;
use super::options::{AzimuthSource, DatasetOptions};

/// Depth of a range bin, m. The development kit of the dataset gives 0.0432, with which paths are
/// 1.4 % shorter than the ground truth.
pub const RANGE_RESOLUTION_M: f32 = 0.0438;

const STAMPS: &str = "Files are named by the stamp of the first row; the time of a scan is the mean of its first and last row's \
                      stamps, as in the ground truth, and the stamps of the rows are a linear fit over the azimuth.";

pub(crate) fn open(found: Found, options: &DatasetOptions) -> Result<NavtechScans, OpenError> {
    NavtechScans::open(found, options, |_| {
        profile(Format::Oxford, AzimuthSource::Encoder)
    })
}

pub(crate) fn open_oord(found: Found, options: &DatasetOptions) -> Result<NavtechScans, OpenError> {
    NavtechScans::open(found, options, |_| {
        profile(Format::Oord, AzimuthSource::Uniform)
    })
}

fn profile(format: Format, azimuth_source: AzimuthSource) -> Profile {
    Profile {
        format,
        range_resolution_m: RANGE_RESOLUTION_M,
        range_offset_m: 0.0,
        doppler_s: 0.0,
        azimuth_eccentricity_rad: 0.0,
        encoder_counts: 5600,
        azimuth_source,
        scan_time: ScanTime::Halfway,
        smooth_stamps: true,
        byte_ten: ByteTen::Validity,
        named_by: NamedBy::Start,
        stamp_meaning: STAMPS,
    }
}
