//! The error of a journal.

use std::path::{Path, PathBuf};

use gyre_storage::{Busy, LogError, StorageError};
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
    #[error(transparent)]
    Log(#[from] LogError),
    /// A file lacks records of poses in the journal.
    #[error("{0}")]
    Missing(String),
}

impl JournalError {
    pub(crate) fn damaged(path: &Path, pose: u64) -> Self {
        let path = path.to_owned();
        Self::Damaged { path, pose }
    }

    /// The state is not in the checkpoint, which is of another version or configuration, or
    /// damaged.
    pub fn no_state(checkpoint: &Path, item: u64) -> Self {
        Self::Missing(format!(
            "{} does not have the state of the refinement before item {item}: start again with --fresh",
            checkpoint.display()
        ))
    }

    /// Returns whether another process has the file: one that was killed may not be gone yet.
    pub fn is_busy(&self) -> bool {
        matches!(self, Self::Busy(_) | Self::Log(LogError::Busy(_)))
    }
}
