//! Boreas, and Boreas Road Trip with its newer radar.
//!
//! `radar/<us>.png`, metadata columns as in Oxford, named by the time of azimuth `n / 2 - 1`.
//! Azimuths are clockwise from ahead; the antenna does not turn quite uniformly, so the encoder is
//! used. A bin is at `bin * resolution - 0.31 m`; whether this is its near edge or its centre is
//! not documented, and half a bin (0.02 m) is below the accuracy of the offset.

use super::detect::Found;
use super::error::OpenError;
use super::first_image::{FirstImage, NamedBy};
use super::format::Format;
use super::navtech_png::ByteTen;
use super::navtech_profile::{Profile, ScanTime};
use super::navtech_scans::NavtechScans;
use super::options::{AzimuthSource, DatasetOptions};
use super::stamp::SECOND_NS;

/// Depth of a range bin before the firmware change of 2021-09-21, m.
pub const OLD_RANGE_RESOLUTION_M: f32 = 0.0596;
/// Depth of a range bin since then, and in Boreas Road Trip, m.
pub const NEW_RANGE_RESOLUTION_M: f32 = 0.04381;
/// Offset of the ranges, m.
pub const RANGE_OFFSET_M: f32 = -0.31;
/// 2021-09-21 00:00 UTC, the date of the firmware change.
const NEW_FIRMWARE_NS: i64 = 1_632_182_400 * SECOND_NS;

const STAMPS: &str = "Files are named by the stamp of azimuth n/2 - 1, the middle of the sweep, which is the time of the scan, as in the ground truth.";

pub(crate) fn open(found: Found, options: &DatasetOptions) -> Result<NavtechScans, OpenError> {
    NavtechScans::open(found, options, |first_image| {
        profile(Format::Boreas, resolution_by_date(first_image))
    })
}

pub(crate) fn open_road_trip(
    found: Found,
    options: &DatasetOptions,
) -> Result<NavtechScans, OpenError> {
    NavtechScans::open(found, options, |_| {
        profile(Format::BoreasRt, NEW_RANGE_RESOLUTION_M)
    })
}

fn resolution_by_date(first_image: Option<&FirstImage>) -> f32 {
    match first_image.and_then(FirstImage::start_ns) {
        Some(ns) if ns < NEW_FIRMWARE_NS => OLD_RANGE_RESOLUTION_M,
        _ => NEW_RANGE_RESOLUTION_M,
    }
}

fn profile(format: Format, range_resolution_m: f32) -> Profile {
    Profile {
        format,
        range_resolution_m,
        range_offset_m: RANGE_OFFSET_M,
        doppler_s: 0.0,
        azimuth_eccentricity_rad: 0.0,
        encoder_counts: 5600,
        azimuth_source: AzimuthSource::Encoder,
        scan_time: ScanTime::MiddleRow,
        smooth_stamps: false,
        byte_ten: ByteTen::Unused,
        named_by: NamedBy::Middle,
        stamp_meaning: STAMPS,
    }
}
