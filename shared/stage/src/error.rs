//! Errors that end a stage.

use std::{fmt::Debug, path::PathBuf};

use thiserror::Error;

/// Why a stage ended. Its exit code tells the supervisor whether starting it again can help.
#[derive(Debug, Error)]
pub enum StageError {
    /// Started by hand.
    #[error(
        "this is one process of a run, and GYRE_RUN, which names the run, is not set: start it with `gyre run CONFIG`"
    )]
    NoRun {
        /// Which stage.
        stage: String,
    },
    /// The run's own files cannot be read.
    #[error("cannot read {path}: {reason}; is the run still there?")]
    Manifest {
        /// Which file.
        path: PathBuf,
        /// What was wrong with it.
        reason: String,
    },
    /// The configuration does not do.
    #[error("{0}")]
    Configuration(String),
    /// The input cannot be used, however often one tries.
    #[error("{0}")]
    Input(String),
    /// The transport failed; a restart usually helps.
    #[error("cannot {action}: {reason}")]
    Transport {
        /// What was tried.
        action: String,
        /// What the transport said.
        reason: String,
    },
    /// An item is missing: it has been overwritten, or was never sent.
    #[error("topic `{topic}`: expected item {expected}, but got {got}")]
    SequenceGap {
        /// On which topic.
        topic: &'static str,
        /// The number that had to come.
        expected: u64,
        /// The number that came.
        got: u64,
    },
    /// A message does not keep its contract.
    #[error("topic `{topic}`, item {seq}: {reason}")]
    Malformed {
        /// On which topic.
        topic: &'static str,
        /// Which item.
        seq: u64,
        /// What is wrong with it.
        reason: String,
    },
    /// A file of the run.
    #[error("{path}: {source}")]
    File {
        /// Which file.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
}

impl StageError {
    /// Exit code of a stage that a restart can heal.
    pub const RESTART: u8 = 3;
    /// Exit code of a stage that would fail the same way again.
    pub const HOPELESS: u8 = 2;

    /// A failure of the transport.
    pub(crate) fn transport(action: impl Into<String>, reason: impl Debug) -> Self {
        Self::Transport {
            action: action.into(),
            reason: format!("{reason:?}"),
        }
    }

    /// What the process exits with.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Transport { .. } | Self::SequenceGap { .. } => Self::RESTART,
            _ => Self::HOPELESS,
        }
    }
}
