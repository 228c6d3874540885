//! RADIATE: `GPS_IMU_Twist/<number>.txt`, a file for each fix, and `GPS_IMU_Twist.txt` with their
//! times.
//!
//! A file begins with latitude, longitude and altitude, and three lines of their covariance, m²
//! along east, north and up.

use std::path::Path;

use crate::frame_stamps;
use gyre_storage as storage;

use super::{GnssLogError, Raw, RawFix};

/// The largest file: they have about 900 bytes.
const MAX_BYTES: u64 = 1 << 16;

/// Returns whether a folder has the list of times beside it.
pub(super) fn is_one(folder: &Path) -> bool {
    folder.with_extension("txt").is_file()
}

pub(super) fn read(folder: &Path) -> Result<Raw, GnssLogError> {
    let list = folder.with_extension("txt");
    if !list.is_file() {
        return Err(GnssLogError::Unknown {
            path: folder.to_owned(),
            reason: format!(
                "a folder of fixes, as RADIATE's GPS_IMU_Twist, needs the list of their times beside it, {}",
                list.display()
            ),
        });
    }
    let mut raw = Raw::default();
    for (number, stamp_ns) in frame_stamps(&list)? {
        let file = folder.join(format!("{number:06}.txt"));
        match read_fix(&file, stamp_ns) {
            Some(fix) => raw.rows.push(fix),
            None => raw.leave_out(usize::try_from(number).unwrap_or_default()),
        }
    }
    Ok(raw)
}

/// Reads a file; `None` if it is missing, or of another form.
fn read_fix(file: &Path, stamp_ns: i64) -> Option<RawFix> {
    let text = storage::read_text(file, MAX_BYTES).ok()?;
    let mut lines = text.lines().map(numbers);
    let [latitude, longitude, altitude_m] = lines.next()??;
    let [east, ..] = lines.next()??;
    let [_, north, _] = lines.next()??;
    Some(RawFix {
        stamp_ns,
        at: [latitude, longitude],
        altitude_m,
        sigma_m: (0.5 * (east + north)).sqrt(),
    })
}

fn numbers(line: &str) -> Option<[f64; 3]> {
    let fields: Option<Vec<f64>> = line
        .split(',')
        .map(|field| field.trim().parse().ok())
        .collect();
    fields?.try_into().ok()
}
