//! RADIATE: `GPS_IMU_Twist/<number>.txt`, a file for each sample, and `GPS_IMU_Twist.txt` with
//! their times.
//!
//! A file has 18 lines of numbers: position; its covariance (3); quaternion; angular rates;
//! accelerations; covariances (9); twist (2).

use std::{fs, path::Path};

use crate::frame_stamps;
use gyre_storage as storage;

use super::{LogError, Raw, table::sample};
use gyre_samples::{Sample, SampleKind};

/// Lines of the angular rates and of the accelerations, from 0.
const RATES: usize = 5;
const ACCELERATIONS: usize = 6;
/// The largest file: they have about 900 bytes.
const MAX_BYTES: u64 = 1 << 16;

/// Returns whether a folder has the list of times beside it.
pub(super) fn is_one(folder: &Path) -> bool {
    folder.with_extension("txt").is_file()
}

pub(super) fn read(folder: &Path) -> Result<Raw, LogError> {
    let list = folder.with_extension("txt");
    if !list.is_file() {
        return Err(LogError::Unknown {
            of: SampleKind::Gyro,
            path: folder.to_owned(),
            reason: format!(
                "a folder of samples, as RADIATE's GPS_IMU_Twist, needs the list of their times beside it, {}",
                list.display()
            ),
        });
    }
    let mut raw = Raw::default();
    for (number, stamp_ns) in frame_stamps(&list)? {
        let file = folder.join(format!("{number:06}.txt"));
        match read_sample(&file, stamp_ns) {
            Some(sample) => raw.samples.push(sample),
            None => raw.leave_out(usize::try_from(number).unwrap_or_default()),
        }
    }
    let is_empty = raw.samples.is_empty();
    match is_empty && fs::read_dir(folder).is_ok_and(|mut files| files.next().is_none()) {
        true => Err(LogError::Unknown {
            of: SampleKind::Gyro,
            path: folder.to_owned(),
            reason: "the folder is empty: unpack the recording anew".to_owned(),
        }),
        false => Ok(raw),
    }
}

/// Reads a file; `None` if it is missing, or of another form.
fn read_sample(file: &Path, stamp_ns: i64) -> Option<Sample> {
    let text = storage::read_text(file, MAX_BYTES).ok()?;
    let rates = numbers(text.lines().nth(RATES)?)?;
    let accelerations = numbers(text.lines().nth(ACCELERATIONS)?)?;
    Some(sample(stamp_ns, rates, accelerations))
}

fn numbers(line: &str) -> Option<[f64; 3]> {
    let fields: Option<Vec<f64>> = line
        .split(',')
        .map(|field| field.trim().parse().ok())
        .collect();
    fields?.try_into().ok()
}
