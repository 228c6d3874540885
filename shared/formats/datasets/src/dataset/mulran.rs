//! MulRan: `sensor_data/radar/polar/<ns>.png` as recorded (3360 rows of range x 400 columns of
//! azimuth, no metadata), or converted to the format of Oxford in `polar_oxford_form/<ns>.png` with
//! stamps in ns. Named by the last row's stamp.
//!
//! Column k as recorded is row k of the other form, where the encoder says 7, 21, ..., 5593 of 5600
//! counts (KAIST03): the middle of the k-th of 400 equal parts of the turn.

use super::detect::Found;
use super::error::OpenError;
use super::first_image::NamedBy;
use super::format::Format;
use super::images::Images;
use super::navtech_png::ByteTen;
use super::navtech_profile::{Profile, ScanTime};
use super::navtech_scans::NavtechScans;
use super::options::{AzimuthSource, DatasetOptions};
use super::stamp;
use super::transposed::{FirstAzimuth, TransposedScans, Turn};

/// Depth of a range bin, m: 200 m over 3360 bins.
pub const RANGE_RESOLUTION_M: f32 = 200.0 / 3360.0;

const STAMPS: &str = "Files are named by the time of the last column; columns are spread uniformly over a turn, which is the time since \
                      the previous file, and the time of a scan is the mean of its columns'.";
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
        smooth_stamps: true,
        byte_ten: ByteTen::Unused,
        named_by: NamedBy::End,
        stamp_meaning: ROW_STAMPS,
    })
}

/// Opens MulRan as recorded.
pub(crate) fn open(found: Found, options: &DatasetOptions) -> Result<TransposedScans, OpenError> {
    let mut scans = TransposedScans::open(found, options, STAMPS, |_| RANGE_RESOLUTION_M)?;
    scans.first_azimuth = FirstAzimuth::HalfAStep;
    let ends_ns = (0..scans.images.len())
        .map(|index| end_ns(&scans.images, index))
        .collect::<Result<Vec<_>, _>>()?;
    let turn_ns = stamp::turn_ns(ends_ns.iter().copied()).unwrap_or(stamp::DEFAULT_TURN_NS);
    let azimuths = scans.azimuths() as i64;
    let turn = |(index, &end_ns): (usize, &i64)| {
        let interval_ns = index.checked_sub(1).map(|before| end_ns - ends_ns[before]);
        let period_ns = interval_ns
            .filter(|ns| (ns - turn_ns).abs() < turn_ns / 5)
            .unwrap_or(turn_ns);
        Turn {
            start_ns: end_ns - period_ns * (azimuths - 1) / azimuths,
            period_ns,
            logged_ns: end_ns,
        }
    };
    scans.period_ns = turn_ns;
    scans.turns = ends_ns.iter().enumerate().map(turn).collect();
    Ok(scans)
}

fn end_ns(images: &Images, index: usize) -> Result<i64, OpenError> {
    images
        .name_stamp_ns(index)
        .ok_or_else(|| OpenError::UnknownLayout {
            path: images.file(index).to_owned(),
            reason: "a MulRan image is named by its time in ns, of the years 2015 to 2040"
                .to_owned(),
            remedy: "rename it, or set the `format` that it is of",
        })
}
