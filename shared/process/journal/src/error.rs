//! The error of a journal.

use std::path::PathBuf;

use gyre_storage::{Busy, StorageError};
use thiserror::Error;

/// An error of a journal.
#[derive(Debug, Error)]
pub enum JournalError {
    /// The file cannot be read or written.
    #[error(transparent)]
    Storage(#[from] StorageError),
    /// The file is not a journal.
    #[error("{path} is not a journal: move it away, or choose another --out")]
    Foreign {
        /// The file.
        path: PathBuf,
    },
    /// The file is a journal of another version of Gyre.
    #[error(
        "{path} is the journal of another version of Gyre: use that one, or choose another --out"
    )]
    OtherVersion {
        /// The file.
        path: PathBuf,
    },
    /// A record is not what was written.
    #[error("{path} is damaged at pose {pose}, although it had been written whole")]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The number of the pose.
        pose: u64,
    },
    /// Another process appends to the file.
    #[error(transparent)]
    Busy(#[from] Busy),
}
