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
    table::{Columns, MAX_BYTES, Rows},
};

/// Folders of images, beside which the log lies too if one of them is given for the dataset.
const IMAGES: [&str; 5] = [
    "radar",
    "Navtech_Polar",
    "navtech",
    "polar",
    "polar_oxford_form",
];

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
    let name = folder.file_name().and_then(|name| name.to_str());
    let is_of_images = name.is_some_and(|name| IMAGES.contains(&name));
    let above = folder.parent().filter(|_| is_of_images);
    [Some(folder), above].into_iter().flatten()
}

pub(crate) fn text(path: &Path, of: &'static str) -> Result<String, LogError> {
    gyre_storage::read_text(path, MAX_BYTES).map_err(|e| LogError::unreadable(of, path, e))
}

pub(crate) fn rows<C: Columns>(path: &Path, of: &'static str) -> Result<Rows<C>, LogError> {
    Rows::of(&text(path, of)?).map_err(|reason| LogError::unknown(of, path, reason))
}
