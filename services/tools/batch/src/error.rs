//! Errors of a batch.

use std::{io, path::PathBuf};

use gyre_stage::StageError;
use gyre_storage::StorageError;
use thiserror::Error;

/// A batch that could not be carried out. The failure of a drive is none: it is in the table.
#[derive(Debug, Error)]
pub enum BatchError {
    /// The list cannot be read.
    #[error("cannot read the list of drives {path}: {source}", path = path.display())]
    List {
        /// The list.
        path: PathBuf,
        /// The system error.
        source: io::Error,
    },
    /// A line of the list.
    #[error("{path}, line {line}: {reason}", path = path.display())]
    Line {
        /// The list.
        path: PathBuf,
        /// The line, from 1; of a folder the entry.
        line: u64,
        /// The fault, and what is expected.
        reason: String,
    },
    /// Nothing to do.
    #[error(
        "{path} names no drive: give a line for each, the path of its recording, or a folder whose sub-folders are recordings; `gyre run` computes one",
        path = path.display()
    )]
    Empty {
        /// The list.
        path: PathBuf,
    },
    /// A task that is not one of those.
    #[error("there is no task {task} of {tasks}: tasks count from 0, so the last one is {}", tasks.saturating_sub(1))]
    NoSuchTask {
        /// The task.
        task: usize,
        /// The number of tasks.
        tasks: usize,
    },
    /// A folder without rows.
    #[error("{path} is not the folder of a batch: no drive has been computed there", path = path.display())]
    NoBatch {
        /// The folder.
        path: PathBuf,
    },
    /// A drive's process cannot be started.
    #[error("cannot start `{program}`: {source}", program = program.display())]
    Start {
        /// The program.
        program: PathBuf,
        /// The system error.
        source: io::Error,
    },
    /// A file cannot be read or written.
    #[error("cannot use {path}: {source}", path = path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The system error.
        source: io::Error,
    },
    /// A file of another version, or one that was changed.
    #[error("{path} is not what this version of gyre writes ({reason}); remove it, and the same command makes it anew", path = path.display())]
    Unknown {
        /// The file.
        path: PathBuf,
        /// The fault.
        reason: String,
    },
    /// A file that cannot be written.
    #[error(transparent)]
    Storage(#[from] StorageError),
    /// Signals.
    #[error(transparent)]
    Stage(#[from] StageError),
    /// A table that cannot be written.
    #[error("cannot write the table: {0}")]
    Table(#[from] csv::Error),
}

impl BatchError {
    /// Returns a function that names the file of a system error.
    pub(crate) fn file(path: impl Into<PathBuf>) -> impl FnOnce(io::Error) -> Self {
        let path = path.into();
        move |source| Self::File { path, source }
    }
}
