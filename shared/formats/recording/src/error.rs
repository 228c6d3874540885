//! The errors of recordings and bags.

use std::{
    fmt::Display,
    io,
    path::{Path, PathBuf},
};

use gyre_datasets::{OpenError, ReadError};
use mcap::McapError;
use thiserror::Error;

/// A recording or a bag that cannot be written or read. Its `Display` is one sentence.
#[derive(Debug, Error)]
pub enum RecordingError {
    #[error("{path}: {source}")]
    Io { path: PathBuf, source: io::Error },
    /// A place of a file is damaged: a sentence.
    #[error("{0}")]
    Damaged(String),
    /// Any other reason: a sentence.
    #[error("{0}")]
    Other(String),
}

impl RecordingError {
    pub(crate) fn io(path: &Path, source: io::Error) -> Self {
        let path = path.to_owned();
        Self::Io { path, source }
    }

    /// Returns whether the disk is full.
    #[must_use]
    pub fn is_full(&self) -> bool {
        matches!(self, Self::Io { source, .. } if gyre_storage::is_full(source))
    }

    pub(crate) fn damaged(path: &Path, offset: u64, reason: impl Display) -> Self {
        let path = path.display();
        Self::Damaged(format!("{path} is damaged at byte {offset}: {reason}"))
    }

    pub(crate) fn foreign(path: &Path, reason: impl Display) -> Self {
        let path = path.display();
        Self::Other(format!("{path} is not a recording of Gyre: {reason}"))
    }

    pub(crate) fn unreadable(path: &Path, reason: impl Display) -> Self {
        Self::Other(format!("the bag {} {reason}", path.display()))
    }

    /// An error of the library, which wraps the error of the system.
    pub(crate) fn of(path: &Path, error: McapError) -> Self {
        match error {
            McapError::Io(source) => Self::io(path, source),
            error => Self::Other(format!("{}: {error}", path.display())),
        }
    }

    /// The error of a scan in a file that is damaged, unless the disk does not give it.
    pub(crate) fn of_scan(self, path: &Path) -> ReadError {
        match self {
            Self::Io { path, source } => ReadError::Io { path, source },
            error => ReadError::Damaged {
                path: path.to_owned(),
                reason: error.to_string(),
            },
        }
    }
}

impl From<RecordingError> for OpenError {
    fn from(error: RecordingError) -> Self {
        match error {
            RecordingError::Io { path, source } => Self::Io { path, source },
            other => Self::Recording(other.to_string()),
        }
    }
}
