//! RADIATE's `GPS_IMU_Twist/<number>.txt`, a file for each sample of its INS, and
//! `GPS_IMU_Twist.txt` with their times.
//!
//! A file has 18 lines of numbers: latitude, longitude and altitude; their covariance, m² along
//! east, north and up (3); quaternion; angular rates; accelerations; covariances (9); twist (2).

use std::path::{Path, PathBuf};

use gyre_storage as storage;

use crate::{OpenError, frame_stamps};

/// The largest file: they have about 900 bytes.
const MAX_BYTES: u64 = 1 << 16;

/// The fault of a file that cannot be read.
pub(crate) const UNREADABLE: &str = "the file of this number is missing, or has another form";

/// A file of the folder.
pub(crate) struct TwistFile {
    /// The number that it is named by.
    pub number: usize,
    /// When the host received it, ns since 1970.
    pub stamp_ns: i64,
    path: PathBuf,
}

/// Returns whether a folder has the list of times beside it.
pub(crate) fn has_list(folder: &Path) -> bool {
    folder.with_extension("txt").is_file()
}

/// Returns the reason for which a folder without the list cannot be read.
pub(crate) fn without_list(folder: &Path) -> String {
    let list = folder.with_extension("txt");
    format!(
        "a folder as RADIATE's GPS_IMU_Twist needs the list of the times of its files beside it, {}",
        list.display()
    )
}

/// Returns the files that the list beside a folder names; they may be missing.
///
/// # Errors
/// A list that cannot be read, or a line of another form.
pub(crate) fn files(folder: &Path) -> Result<Vec<TwistFile>, OpenError> {
    let file = |(number, stamp_ns): (i64, i64)| TwistFile {
        number: usize::try_from(number).unwrap_or_default(),
        stamp_ns,
        path: folder.join(format!("{number:06}.txt")),
    };
    let stamps = frame_stamps(&folder.with_extension("txt"))?;
    Ok(stamps.into_iter().map(file).collect())
}

impl TwistFile {
    /// Reads these lines, counted from 0, each of three numbers; `None` if the file is missing, or
    /// of another form.
    pub fn read<const N: usize>(&self, lines: [usize; N]) -> Option<[[f64; 3]; N]> {
        let text = storage::read_text(&self.path, MAX_BYTES).ok()?;
        let all: Vec<&str> = text.lines().collect();
        let read = lines.map(|line| numbers(all.get(line)?));
        match read.iter().all(Option::is_some) {
            true => Some(read.map(Option::unwrap_or_default)),
            false => None,
        }
    }
}

fn numbers(line: &str) -> Option<[f64; 3]> {
    let fields: Option<Vec<f64>> = line
        .split(',')
        .map(|field| field.trim().parse().ok())
        .collect();
    fields?.try_into().ok()
}
