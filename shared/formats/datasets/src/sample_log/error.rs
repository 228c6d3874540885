//! The errors of logs.

use std::{
    fmt::Display,
    io,
    path::{Path, PathBuf},
};

use gyre_geometry::samples::SampleKind;
use thiserror::Error;

use super::kinds::Kind;
use crate::OpenError;

/// A log that cannot be used. Each message names the fault, its place and a remedy.
#[derive(Debug, Error)]
pub enum LogError {
    #[error(
        "no log of {} lies beside the scans in {folder}: name one with {section}.kind = \"log\" and {section}.file, or set {section}.kind = \"none\"",
        Kind::of(*of).one,
        section = of.section()
    )]
    None { of: SampleKind, folder: PathBuf },
    #[error(
        "the only log beside the scans is {path}, of which the ground truth was computed, so that an evaluation with it says little: name it in gyro.file if it is to be used all the same"
    )]
    InTruth { path: PathBuf },
    #[error(
        "{}.kind is that of a live sensor, but the scans are of a recording: set it to `auto`, `log` or `none`",
        of.section()
    )]
    Live { of: SampleKind },
    #[error("{0}")]
    Unusable(String),
    /// A bag, or the list of the times of RADIATE's files.
    #[error(transparent)]
    Open(#[from] OpenError),
}

impl LogError {
    /// A log without a table of the sensor.
    pub(crate) fn unknown(of: SampleKind, path: &Path, reason: impl Display) -> Self {
        let (path, one) = (path.display(), Kind::of(of).one);
        Self::Unusable(format!("{path} is no log of {one}: {reason}"))
    }

    pub(crate) fn unusable(of: SampleKind, path: &Path, reason: impl Display) -> Self {
        let (path, name) = (path.display(), Kind::of(of).name);
        Self::Unusable(format!(
            "the log of the {name} {path} cannot be used: {reason}"
        ))
    }

    pub(crate) fn unreadable(of: SampleKind, path: &Path, source: io::Error) -> Self {
        let (path, name) = (path.display(), Kind::of(of).name);
        Self::Unusable(format!(
            "cannot read the log of the {name} {path}: {source}"
        ))
    }
}
