//! MulRan as recorded: `sensor_data/radar/polar/<ns>.png`, 3360 rows of range x 400 columns of
//! azimuth without metadata, named by the last row's stamp.
//!
//! Column k is row k of the form of Oxford, where the encoder gives 7, 21, ..., 5593 of 5600 counts
//! (KAIST03): the middle of the k-th of 400 equal parts of the turn.

use super::detect::Found;
use super::error::OpenError;
use super::images::Images;
use super::options::DatasetOptions;
use super::profiles::MULRAN_RESOLUTION_M;
use super::stamp;
use super::transposed::{TransposedScans, Turn};

const STAMPS: &str = "Files are named by the time of the last column; columns are spread uniformly over a turn, which is the time since \
                      the previous file, and the time of a scan is the mean of its columns'.";

pub(crate) fn open(found: Found, options: &DatasetOptions) -> Result<TransposedScans, OpenError> {
    let mut scans = TransposedScans::open(found, options, STAMPS, |_| MULRAN_RESOLUTION_M)?;
    scans.first_azimuth = 0.5;
    let ends_ns = (0..scans.images.len()).map(|index| end_ns(&scans.images, index));
    let ends_ns = ends_ns.collect::<Result<Vec<_>, _>>()?;
    let turn_ns = stamp::turn_ns(ends_ns.iter().copied()).unwrap_or(stamp::DEFAULT_TURN_NS);
    let azimuths = scans.azimuths() as i64;
    let turn = |(index, &end_ns): (usize, &i64)| {
        let interval_ns = index.checked_sub(1).map(|before| end_ns - ends_ns[before]);
        let period_ns = interval_ns.filter(|ns| (ns - turn_ns).abs() < turn_ns / 5);
        let period_ns = period_ns.unwrap_or(turn_ns);
        Turn {
            start_ns: end_ns - period_ns * (azimuths - 1) / azimuths,
            period_ns,
            logged_ns: end_ns,
        }
    };
    scans.properties.period_ns = turn_ns;
    scans.turns = ends_ns.iter().enumerate().map(turn).collect();
    Ok(scans)
}

fn end_ns(images: &Images, index: usize) -> Result<i64, OpenError> {
    images.name_stamp_ns(index).ok_or_else(|| {
        let reason = "a MulRan image is named by its time in ns, of the years 2015 to 2040";
        let remedy = "rename it, or set the `format` that it is of";
        OpenError::unknown_layout(images.file(index), reason, remedy)
    })
}
