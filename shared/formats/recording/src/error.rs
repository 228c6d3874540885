//! The errors of recordings and bags.

use std::{
    io,
    path::{Path, PathBuf},
};

use gyre_datasets::OpenError;
use gyre_ros2_messages::BadMessage;
use mcap::McapError;
use thiserror::Error;

/// A recording or a bag that cannot be written or read. Its `Display` is one sentence.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages explain the variants and fields")]
pub enum RecordingError {
    #[error("{path}: {source}")]
    Io { path: PathBuf, source: io::Error },
    /// An error of the library.
    #[error("{path}: {source}")]
    Mcap { path: PathBuf, source: McapError },
    #[error(
        "{0} does not begin with the signature of MCAP: it is another file, or was not copied whole"
    )]
    NoMcap(PathBuf),
    #[error("{path} is not a recording of Gyre: {reason}")]
    Foreign { path: PathBuf, reason: String },
    /// A bag that cannot be read as it is.
    #[error("the bag {path} {reason}")]
    Unreadable { path: PathBuf, reason: String },
    #[error("{path} is damaged at byte {offset}: {reason}")]
    Damaged {
        path: PathBuf,
        offset: u64,
        reason: String,
    },
    #[error(
        "{path} has no message {seq} of topic `{topic}`: the recorder missed it, or the topic was not among its --topics"
    )]
    Absent {
        path: PathBuf,
        topic: String,
        seq: u64,
    },
    #[error("cannot write a message: {0}")]
    Message(#[from] BadMessage),
    #[error("cannot write {path}: {reason}")]
    Unwritable { path: PathBuf, reason: String },
}

impl RecordingError {
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

    /// An error of the library, which wraps the error of the system.
    pub(crate) fn of(path: &Path, error: McapError) -> Self {
        let path = path.to_owned();
        match error {
            McapError::Io(source) => Self::Io { path, source },
            source => Self::Mcap { path, source },
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
