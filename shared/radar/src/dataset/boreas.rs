//! Boreas, and Boreas Road Trip with its newer radar.
//!
//! `radar/<us>.png`, Oxford's columns, named by the time of azimuth `n / 2 - 1`. Azimuths clockwise from ahead; the antenna does
//! not turn quite evenly, so that the encoder is to be believed. A bin lies at `bin * resolution - 0.31 m`; whether its near edge
//! or its centre is meant is not said, and half a bin (0.02 m) is below what the offset is known to.

use super::detect::Found;
use super::error::OpenError;
use super::first_look::{FirstLook, NamedBy};
use super::format::Format;
use super::navtech_png::ByteTen;
use super::navtech_scans::{NavtechScans, Profile, ScanTime};
use super::options::{AzimuthSource, DatasetOptions};
use super::stamp::SECOND_NS;

/// Metres a range bin before 2021-09-21, when the radar's firmware was changed.
pub const OLD_RANGE_RESOLUTION_M: f32 = 0.0596;
/// Metres a range bin since then, and in Boreas Road Trip.
pub const NEW_RANGE_RESOLUTION_M: f32 = 0.04381;
/// Metres to add to every range.
pub const RANGE_OFFSET_M: f32 = -0.31;
/// 2021-09-21 00:00 UTC: the radar's firmware was changed.
const NEW_FIRMWARE_NS: i64 = 1_632_182_400 * SECOND_NS;

const STAMPS: &str = "Files are named by the time of azimuth n/2 - 1, the sweep's middle; that row's stamp is the scan's time, as in the ground truth.";

pub(crate) fn open(found: Found, options: &DatasetOptions) -> Result<NavtechScans, OpenError> {
    NavtechScans::open(found, options, |look| {
        profile(Format::Boreas, resolution_by_date(look))
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

fn resolution_by_date(look: Option<&FirstLook>) -> f32 {
    match look.and_then(FirstLook::start_ns) {
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
