//! The error of a journal.

use std::path::{Path, PathBuf};

use gyre_storage::{Busy, StorageError};
use thiserror::Error;

#[derive(Debug, Error)]
pub enum JournalError {
    #[error(transparent)]
    Storage(#[from] StorageError),
    #[error("{path} is not a journal: move it away, or choose another --out")]
    Foreign { path: PathBuf },
    #[error(
        "{path} is the journal of another version of Gyre: use that one, or choose another --out"
    )]
    OtherVersion { path: PathBuf },
    #[error("{path} is damaged at pose {pose}, although it had been written whole")]
    Damaged { path: PathBuf, pose: u64 },
    #[error(transparent)]
    Busy(#[from] Busy),
}

impl JournalError {
    pub(crate) fn damaged(path: &Path, pose: u64) -> Self {
        let path = path.to_owned();
        Self::Damaged { path, pose }
    }
}
