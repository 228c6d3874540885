//! RADIATE: the rates and accelerations in `GPS_IMU_Twist`.

use std::{fs, path::Path};

use super::{LogError, Raw, columns::sample};
use crate::gps_imu_twist::{TwistFile, UNREADABLE, files, has_list, without_list};
use gyre_samples::{Sample, SampleKind};

/// Lines of the angular rates and of the accelerations, from 0.
const LINES: [usize; 2] = [5, 6];

pub(super) fn read(folder: &Path) -> Result<Raw, LogError> {
    let unknown = |reason| LogError::Unknown {
        of: SampleKind::Gyro,
        path: folder.to_owned(),
        reason,
    };
    if !has_list(folder) {
        return Err(unknown(without_list(folder)));
    }
    let mut raw = Raw::default();
    for file in files(folder)? {
        match read_sample(&file) {
            Some(sample) => raw.samples.push(sample),
            None => raw.unreadable.add(1, file.number, || UNREADABLE.to_owned()),
        }
    }
    let is_empty = raw.samples.is_empty();
    match is_empty && fs::read_dir(folder).is_ok_and(|mut files| files.next().is_none()) {
        true => Err(unknown(
            "the folder is empty: unpack the recording anew".to_owned(),
        )),
        false => Ok(raw),
    }
}

fn read_sample(file: &TwistFile) -> Option<Sample> {
    let [rates, accelerations] = file.read(LINES)?;
    Some(sample(file.stamp_ns, rates, accelerations))
}
