//! The common part of the logs of gyro, wheels and GNSS: their places beside the scans, their
//! readers, and their errors.

use std::{
    fmt::Display,
    io,
    path::{Path, PathBuf},
};

use thiserror::Error;

use crate::{
    OpenError,
    dataset::is_folder_of_images,
    frame_stamps,
    table::{Columns, MAX_BYTES, Raw, Rows},
};

/// The largest file of `GPS_IMU_Twist`: they have about 900 bytes.
const MAX_TWIST_BYTES: u64 = 1 << 16;
const UNREADABLE: &str = "the file of this number is missing, or has another form";

/// A log that cannot be used. `of` is the section of the sensor in configurations. Each message
/// names the fault, its place and a remedy.
#[derive(Debug, Error)]
pub enum LogError {
    #[error(
        "no log of {} lies beside the scans in {folder}: name one with {of}.kind = \"log\" and {of}.file, or set {of}.kind = \"none\"",
        one(of)
    )]
    None { of: &'static str, folder: PathBuf },
    #[error(
        "the only log beside the scans is {path}, of which the ground truth was computed, so that an evaluation with it says little: name it in gyro.file if it is to be used all the same"
    )]
    InTruth { path: PathBuf },
    #[error(
        "{of}.kind is that of a live sensor, but the scans are of a recording: set it to `auto`, `log` or `none`"
    )]
    Live { of: &'static str },
    #[error("{0}")]
    Unusable(String),
    /// A bag, or the list of the times of RADIATE's files.
    #[error(transparent)]
    Open(#[from] OpenError),
}

impl LogError {
    /// A log without a table of the sensor.
    pub(crate) fn unknown(of: &str, path: &Path, reason: impl Display) -> Self {
        let (path, one) = (path.display(), one(of));
        Self::Unusable(format!("{path} is no log of {one}: {reason}"))
    }

    pub(crate) fn unusable(of: &str, path: &Path, reason: impl Display) -> Self {
        let (path, name) = (path.display(), name(of));
        Self::Unusable(format!(
            "the log of the {name} {path} cannot be used: {reason}"
        ))
    }

    pub(crate) fn unreadable(of: &str, path: &Path, source: io::Error) -> Self {
        let (path, name) = (path.display(), name(of));
        Self::Unusable(format!(
            "cannot read the log of the {name} {path}: {source}"
        ))
    }
}

fn one(section: &str) -> &str {
    match section {
        "gyro" => "a gyro",
        "wheels" => "the wheels",
        _ => "a GNSS receiver",
    }
}

fn name(section: &str) -> &str {
    match section {
        "gnss" => "GNSS receiver",
        other => other,
    }
}

/// Returns the first of these places with a log beside the scans of a dataset folder. The folder of
/// the images may be given instead.
pub(crate) fn find(folder: &Path, of: &'static str, places: &[&str]) -> Result<PathBuf, LogError> {
    let mut paths = roots(folder).flat_map(|root| places.iter().map(|place| root.join(place)));
    // RADIATE's folder has a list of times beside it.
    let is_folder = |path: &Path| path.is_dir() && path.with_extension("txt").is_file();
    let found = paths.find(|path| path.is_file() || is_folder(path));
    found.ok_or_else(|| LogError::None {
        of,
        folder: folder.to_owned(),
    })
}

/// Returns the folders that may contain the logs of a dataset: its own, and the parent of a folder
/// of images.
pub(crate) fn roots(folder: &Path) -> impl Iterator<Item = &Path> {
    let above = folder.parent().filter(|_| is_folder_of_images(folder));
    [Some(folder), above].into_iter().flatten()
}

pub(crate) fn text(path: &Path, of: &'static str) -> Result<String, LogError> {
    gyre_storage::read_text(path, MAX_BYTES).map_err(|e| LogError::unreadable(of, path, e))
}

pub(crate) fn rows<C: Columns>(path: &Path, of: &'static str) -> Result<Rows<C>, LogError> {
    Rows::of(&text(path, of)?).map_err(|reason| LogError::unknown(of, path, reason))
}

/// Reads RADIATE's `GPS_IMU_Twist/<number>.txt`, a file for each sample of its INS, and
/// `GPS_IMU_Twist.txt` with their times: the files that the list beside a folder names. `entry`
/// makes an entry of a time, ns since 1970, and of these lines, counted from 0, each of three
/// numbers.
///
/// A file has 18 lines of numbers: latitude, longitude and altitude; their covariance, m² along
/// east, north and up (3); quaternion; angular rates; accelerations; covariances (9); twist (2).
pub(crate) fn gps_imu_twist<T, const N: usize>(
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
    let text = gyre_storage::read_text(path, MAX_TWIST_BYTES).ok()?;
    let all: Vec<&str> = text.lines().collect();
    let mut read = [[0.0; 3]; N];
    for (into, line) in read.iter_mut().zip(lines) {
        let fields = all.get(line)?.split(',');
        let fields: Option<Vec<f64>> = fields.map(|field| field.trim().parse().ok()).collect();
        *into = fields?.try_into().ok()?;
    }
    Some(read)
}
