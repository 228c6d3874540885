//! The errors of recordings.

use std::{
    io,
    path::{Path, PathBuf},
};

use mcap::McapError;
use thiserror::Error;

/// A recording that cannot be written or read.
#[derive(Debug, Error)]
pub enum RecordingError {
    /// The system refuses it.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// The system error.
        source: io::Error,
    },
    /// The library cannot write or read it.
    #[error("{path}: {source}")]
    Mcap {
        /// The file.
        path: PathBuf,
        /// The library's error.
        source: McapError,
    },
    /// Not a recording of a run.
    #[error("{path} is not a recording of Gyre: {reason}")]
    Foreign {
        /// The file.
        path: PathBuf,
        /// The missing part.
        reason: String,
    },
    /// A part of it is damaged.
    #[error("{path} is damaged at byte {offset}: {reason}")]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The position of the record.
        offset: u64,
        /// The problem.
        reason: String,
    },
    /// A message that was not recorded.
    #[error(
        "{path} has no message {seq} of topic `{topic}`: the recorder missed it, or the topic was not among its --topics"
    )]
    Absent {
        /// The file.
        path: PathBuf,
        /// The topic.
        topic: String,
        /// The sequence number.
        seq: u64,
    },
}

impl RecordingError {
    /// An error of the library. It hides what the system says.
    pub(crate) fn of(path: &Path, error: McapError) -> Self {
        let path = path.to_owned();
        match error {
            McapError::Io(source) => Self::Io { path, source },
            source => Self::Mcap { path, source },
        }
    }
}
