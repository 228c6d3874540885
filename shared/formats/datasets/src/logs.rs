//! The common part of the logs of gyro, wheels and GNSS: their places beside the scans, their
//! readers, and their errors.

use std::{
    io,
    path::{Path, PathBuf},
};

use gyre_storage as storage;
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
#[allow(missing_docs, reason = "the messages explain the variants and fields")]
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
    #[error("cannot read the log of the {} {path}: {source}", name(of))]
    Io {
        of: &'static str,
        path: PathBuf,
        source: io::Error,
    },
    #[error("{path} is no log of {}: {reason}", one(of))]
    Unknown {
        of: &'static str,
        path: PathBuf,
        reason: String,
    },
    #[error("the log of the {} {path} cannot be used: {reason}", name(of))]
    Unusable {
        of: &'static str,
        path: PathBuf,
        reason: String,
    },
    /// `steps` describes the steps of the clock, if there are any, in sentences that end with a
    /// space.
    #[error(
        "the log of the {of} {path} has no sample while the scans were measured: it begins {after_s:.1} s after the first of them. {steps}It is of another drive, or {of}.delay_s is wrong"
    )]
    Elsewhere {
        of: &'static str,
        path: PathBuf,
        after_s: f64,
        steps: String,
    },
    #[error(
        "the bag {bag} has no messages of sensor_msgs/msg/NavSatFix, and no log of a GNSS receiver lies beside it: name one with gnss.kind = \"log\" and gnss.file, or set gnss.kind = \"none\""
    )]
    NoneInBag { bag: PathBuf },
    #[error(
        "gnss.topic is {topic}, but {data} is no bag of ROS 2: remove it, and the log beside the scans is used"
    )]
    NoBag { topic: String, data: PathBuf },
    /// A bag, or the list of the times of RADIATE's files.
    #[error(transparent)]
    Open(#[from] OpenError),
}

/// Returns the sensor of a section in words.
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

/// Returns whether a folder has RADIATE's list of times beside it.
fn has_list(folder: &Path) -> bool {
    folder.with_extension("txt").is_file()
}

/// Returns the first of these places with a log beside the scans of a dataset folder. The folder of
/// the images may be given instead.
pub(crate) fn find(folder: &Path, of: &'static str, places: &[&str]) -> Result<PathBuf, LogError> {
    let mut paths = roots(folder).flat_map(|root| places.iter().map(|place| root.join(place)));
    let found = paths.find(|path| path.is_file() || (path.is_dir() && has_list(path)));
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

/// Reads the text of a log.
pub(crate) fn text(path: &Path, of: &'static str) -> Result<String, LogError> {
    storage::read_text(path, MAX_BYTES).map_err(|source| LogError::Io {
        of,
        path: path.to_owned(),
        source,
    })
}

/// Reads a log that is a table.
pub(crate) fn rows<C: Columns>(path: &Path, of: &'static str) -> Result<Rows<C>, LogError> {
    Rows::of(&text(path, of)?).map_err(|reason| LogError::Unknown {
        of,
        path: path.to_owned(),
        reason,
    })
}
