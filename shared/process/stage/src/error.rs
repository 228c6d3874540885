//! The errors that end a stage.

use std::{fmt::Debug, path::PathBuf};

use gyre_storage::LogError;
use thiserror::Error;

use crate::shared_memory::{self, SHARED_MEMORY};

/// An error that ends a stage. The exit code informs the supervisor whether a restart can help.
#[derive(Debug, Error)]
pub enum StageError {
    #[error(
        "this is one process of a run, and GYRE_RUN is not set: start the run with `gyre run CONFIG`"
    )]
    NoRun { stage: String },
    #[error("cannot read {path}: {reason}; is the run still there?")]
    Manifest { path: PathBuf, reason: String },
    #[error("no run is writing to {out}{end}: `gyre run` starts one, and its --out names the folder", out = out.display())]
    NotRunning {
        /// The folder of the results.
        out: PathBuf,
        /// When and why the last run there ended, in parentheses.
        end: String,
    },
    #[error("the run that writes to {out} does not answer: {reason}")]
    Silent {
        /// The folder of the results.
        out: PathBuf,
        reason: String,
    },
    #[error("{0}")]
    Refused(String),
    #[error(
        "the {observers} places for observers of topic `{topic}` are taken: wait until one leaves, or raise run.observers"
    )]
    NoPlace {
        topic: &'static str,
        observers: usize,
    },
    #[error("the run that writes to {out} has no topic `{topic}`: only a run with {needs} has it")]
    NoTopic {
        topic: &'static str,
        /// The property of a run that has it.
        needs: &'static str,
        /// The folder of the results.
        out: PathBuf,
    },
    #[error("{0}")]
    Configuration(String),
    /// The input cannot be used, and a restart would not change that.
    #[error("{0}")]
    Input(String),
    /// A function of the user's has failed. Its process may have been killed: another attempt may
    /// help.
    #[error("{0}")]
    Function(String),
    /// The transport failed; a restart usually helps.
    #[error("cannot {action}: {reason}")]
    Transport {
        action: String,
        /// The transport's error.
        reason: String,
    },
    #[error("topic `{topic}`: expected item {expected}, but got {got}")]
    SequenceGap {
        topic: &'static str,
        expected: u64,
        got: u64,
    },
    #[error("topic `{topic}`, item {seq}, sent by {sender}: {reason}")]
    Malformed {
        topic: &'static str,
        /// The stage that sent it.
        sender: &'static str,
        seq: u64,
        reason: String,
    },
    /// There is too little shared memory. A dead process may have left some that is about to be
    /// freed.
    #[error(
        "shared memory at /dev/shm has no room for the {megabytes:.1} MB of topic `{topic}` ({source}): free some, enlarge it \
         (containers: --shm-size), or lower run.window or raster.n"
    )]
    NoMemory {
        topic: &'static str,
        /// The size of its segment, MB.
        megabytes: f64,
        source: std::io::Error,
    },
    #[error("{path}: {source}")]
    File {
        path: PathBuf,
        source: std::io::Error,
    },
}

impl StageError {
    /// Exit code after an error that a restart may resolve.
    pub const TRANSIENT: u8 = 3;
    /// Exit code after an error that would occur again.
    pub const PERMANENT: u8 = 2;

    /// Creates an error of the transport.
    pub fn transport(action: impl Into<String>, reason: impl Debug) -> Self {
        // The transport does not name this cause.
        let full = match shared_memory::is_full() {
            true => format!("; {SHARED_MEMORY} is full"),
            false => String::new(),
        };
        Self::Transport {
            action: action.into(),
            reason: format!("{reason:?}{full}"),
        }
    }

    /// Returns the exit code of the process.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Transport { .. }
            | Self::SequenceGap { .. }
            | Self::Malformed { .. }
            | Self::Function(_)
            | Self::NoMemory { .. } => Self::TRANSIENT,
            _ => Self::PERMANENT,
        }
    }
}

impl From<LogError> for StageError {
    /// For a process that follows a log. Another attempt helps where a process that was killed is
    /// not gone yet, or where the one that appends has been cutting off a record that was being
    /// read.
    fn from(error: LogError) -> Self {
        match error {
            LogError::Foreign { .. } | LogError::Malformed { .. } => Self::Input(error.to_string()),
            _ => Self::Transport {
                action: "use a log of the run".to_owned(),
                reason: error.to_string(),
            },
        }
    }
}
