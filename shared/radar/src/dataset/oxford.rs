//! Oxford Radar RobotCar, and the Offroad dataset that took its form.
//!
//! `radar/<us>.png`, 400 azimuths x (11 + 3768), named by the start of the sweep; azimuths clockwise from ahead.
//! OORD keeps the images in `Navtech_CTS350-X_Radar/`, and its encoder columns are not to be trusted.

use super::detect::Found;
use super::error::OpenError;
use super::first_look::NamedBy;
use super::format::Format;
use super::navtech_png::ByteTen;
use super::navtech_scans::{NavtechScans, Profile, ScanTime};
use super::options::{AzimuthSource, DatasetOptions};

/// Metres a range bin. The dataset's own kit says 0.0432, with which paths come out 1.4 % short of the ground truth.
pub const RANGE_RESOLUTION_M: f32 = 0.0438;

const STAMPS: &str = "Files are named by the time of the sweep's first row; a scan's time is half-way between its first and \
                      last row's stamps, which is also what the ground truth refers to, and rows are spread along it by their azimuth.";

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
