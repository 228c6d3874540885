//! The errors that end a stage.

use std::{
    fmt::{Debug, Display},
    io,
    path::{Path, PathBuf},
};

use gyre_storage::{LogError, StorageError};
use thiserror::Error;

use crate::shared_memory::{self, SHARED_MEMORY};

/// An error that ends a stage. The exit code informs the supervisor whether a restart can help.
#[derive(Debug, Error)]
pub enum RunError {
    #[error("stopped")]
    Stopped,
    #[error("no run is writing to {out}{end}: `gyre run` starts one, and its --out names the folder", out = out.display())]
    NotRunning {
        out: PathBuf,
        /// When and why the last run there ended, in parentheses.
        end: String,
    },
    #[error(
        "the {observers} places for observers of topic `{topic}` are taken: wait until one leaves, or raise run.observers"
    )]
    NoPlace {
        topic: &'static str,
        observers: usize,
    },
    /// The input or the configuration cannot be used, and a restart would not change that.
    #[error("{0}")]
    Input(String),
    /// Another attempt may help, as after a failure of the transport.
    #[error("{0}")]
    Transient(String),
    #[error("topic `{topic}`, item {seq}, sent by {sender}: {reason}")]
    Malformed {
        topic: &'static str,
        sender: &'static str,
        seq: u64,
        reason: String,
    },
    #[error("{path}: {source}")]
    File { path: PathBuf, source: io::Error },
}

impl RunError {
    /// Exit code after an error that a restart may resolve.
    pub const TRANSIENT: u8 = 3;
    /// Exit code after an error that would occur again.
    pub const PERMANENT: u8 = 2;

    pub fn transport(action: impl Display, reason: impl Debug) -> Self {
        // The transport does not name this cause.
        let full = match shared_memory::is_full() {
            true => format!("; {SHARED_MEMORY} is full"),
            false => String::new(),
        };
        Self::Transient(format!("cannot {action}: {reason:?}{full}"))
    }

    pub fn gap(topic: &str, expected: u64, got: u64) -> Self {
        Self::Transient(format!(
            "topic `{topic}`: expected item {expected}, but got {got}"
        ))
    }

    pub fn input(error: impl Display) -> Self {
        Self::Input(error.to_string())
    }

    /// Names the file of an error.
    pub fn file(path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::File {
            path: path.to_owned(),
            source,
        }
    }

    pub fn manifest(path: &Path, reason: impl Display) -> Self {
        let path = path.display();
        Self::Input(format!(
            "cannot read {path}: {reason}; is the run still there?"
        ))
    }

    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Malformed { .. } | Self::Transient(_) => Self::TRANSIENT,
            _ => Self::PERMANENT,
        }
    }
}

impl From<StorageError> for RunError {
    fn from(StorageError { path, source, .. }: StorageError) -> Self {
        Self::File { path, source }
    }
}

impl From<LogError> for RunError {
    /// For a process that follows a log. Another attempt helps where a process that was killed is
    /// not gone yet, or where the one that appends has been cutting off a record that was being
    /// read.
    fn from(error: LogError) -> Self {
        match error {
            LogError::Storage(_) | LogError::Damaged { .. } | LogError::Busy(_) => {
                Self::Transient(format!("cannot use a log of the run: {error}"))
            }
            _ => Self::Input(error.to_string()),
        }
    }
}
