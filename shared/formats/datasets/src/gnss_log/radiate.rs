//! RADIATE: the places in `GPS_IMU_Twist`.

use std::path::Path;

use gyre_samples::RawFix;

use super::{GnssLogError, Raw};
use crate::gps_imu_twist::{TwistFile, UNREADABLE, files, has_list, without_list};

/// Lines of the place and of the first two rows of its covariance, from 0.
const LINES: [usize; 3] = [0, 1, 2];

pub(super) fn read(folder: &Path) -> Result<Raw, GnssLogError> {
    if !has_list(folder) {
        return Err(GnssLogError::Unknown {
            path: folder.to_owned(),
            reason: without_list(folder),
        });
    }
    let mut raw = Raw::default();
    for file in files(folder)? {
        match read_fix(&file) {
            Some(fix) => raw.rows.push(fix),
            None => raw.unreadable.add(1, file.number, || UNREADABLE.to_owned()),
        }
    }
    Ok(raw)
}

fn read_fix(file: &TwistFile) -> Option<RawFix> {
    let [[latitude, longitude, altitude_m], [east, ..], [_, north, _]] = file.read(LINES)?;
    Some(RawFix {
        stamp_ns: file.stamp_ns,
        at: [latitude, longitude],
        altitude_m,
        sigma_m: RawFix::sigma_of([east, north]),
        ..RawFix::default()
    })
}
