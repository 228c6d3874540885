//! RADIATE's `GPS_IMU_Twist/<number>.txt`, a file for each sample of its INS, and
//! `GPS_IMU_Twist.txt` with their times.
//!
//! A file has 18 lines of numbers: latitude, longitude and altitude; their covariance, m² along
//! east, north and up (3); quaternion; angular rates; accelerations; covariances (9); twist (2).

use std::path::Path;

use gyre_storage as storage;

use crate::{LogError, frame_stamps, table::Raw};

/// The largest file: they have about 900 bytes.
const MAX_BYTES: u64 = 1 << 16;
const UNREADABLE: &str = "the file of this number is missing, or has another form";

/// Reads the files that the list beside a folder names. `entry` makes an entry of a time, ns since
/// 1970, and of these lines, counted from 0, each of three numbers.
pub(crate) fn read<T, const N: usize>(
    folder: &Path,
    lines: [usize; N],
    entry: impl Fn(i64, [[f64; 3]; N]) -> T,
) -> Result<Raw<T>, LogError> {
    let list = folder.with_extension("txt");
    let mut raw = Raw::of(Vec::new());
    for (number, stamp_ns) in frame_stamps(&list)? {
        match numbers(&folder.join(format!("{number:06}.txt")), lines) {
            Some(numbers) => raw.entries.push(entry(stamp_ns, numbers)),
            None => {
                let number = usize::try_from(number).unwrap_or_default();
                raw.unreadable.add(1, number, || UNREADABLE.to_owned());
            }
        }
    }
    Ok(raw)
}

fn numbers<const N: usize>(path: &Path, lines: [usize; N]) -> Option<[[f64; 3]; N]> {
    let text = storage::read_text(path, MAX_BYTES).ok()?;
    let all: Vec<&str> = text.lines().collect();
    let mut read = [[0.0; 3]; N];
    for (into, line) in read.iter_mut().zip(lines) {
        let fields = all.get(line)?.split(',');
        let fields: Option<Vec<f64>> = fields.map(|field| field.trim().parse().ok()).collect();
        *into = fields?.try_into().ok()?;
    }
    Some(read)
}
