//! Why a bag cannot be read or written.

use std::{
    io,
    path::{Path, PathBuf},
};

use gyre_datasets::OpenError;
use gyre_ros2_messages::BadMessage;
use thiserror::Error;

/// Why a bag cannot be read or written. Its `Display` is one sentence.
#[derive(Debug, Error)]
pub enum BagError {
    /// The disk.
    #[error("cannot access {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The failure.
        source: io::Error,
    },
    /// A bag that cannot be read as it is.
    #[error("the bag {} {reason}", path.display())]
    Unreadable {
        /// The file or folder.
        path: PathBuf,
        /// Why, and what to do.
        reason: String,
    },
    /// Part of a file.
    #[error("the bag {} is damaged at byte {offset}: {reason}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The position.
        offset: u64,
        /// The problem there.
        reason: String,
    },
    /// A message that cannot be written.
    #[error("cannot write a message: {0}")]
    Message(#[from] BadMessage),
    /// A file that cannot be written.
    #[error("cannot write {}: {reason}", path.display())]
    Unwritable {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
}

impl BagError {
    pub(crate) fn io(path: &Path, source: io::Error) -> Self {
        Self::Io {
            path: path.to_owned(),
            source,
        }
    }

    pub(crate) fn unreadable(path: &Path, reason: impl Into<String>) -> Self {
        Self::Unreadable {
            path: path.to_owned(),
            reason: reason.into(),
        }
    }
}

impl From<BagError> for OpenError {
    fn from(error: BagError) -> Self {
        match error {
            BagError::Io { path, source } => Self::Io { path, source },
            other => Self::Recording(other.to_string()),
        }
    }
}
