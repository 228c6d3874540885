//! Errors of a stress test.

use std::{io, path::PathBuf};

use gyre_stage::StageError;
use thiserror::Error;

/// A stress test that could not be carried out, which is no verdict on the pipeline's latency.
#[derive(Debug, Error)]
pub enum StressError {
    /// A process could not be started.
    #[error("cannot start `{program}`: {source}")]
    Start {
        program: String,
        /// The system error.
        source: io::Error,
    },
    /// A run ended before its first poses.
    #[error("the run of {scenario} ended before it could be measured: {said}")]
    EndedEarly {
        scenario: String,
        /// The last line that the run printed.
        said: String,
    },
    /// A run made no pose.
    #[error(
        "the run of {scenario} has made no pose within {limit_s} s; {log} shows what it waits for"
    )]
    NoPose {
        scenario: String,
        /// The time limit, s.
        limit_s: u64,
        /// The output of the run.
        log: PathBuf,
    },
    /// A run without places for observers.
    #[error(
        "run.observers is 0, and the stress test looks on as an observer: set run.observers to 1 or more"
    )]
    NoPlace,
    /// A time too short for the scenario.
    #[error(
        "{scenario} needs --duration {least_s} or more: time for a fault, and for the recovery from it"
    )]
    TooShort {
        scenario: &'static str,
        /// The shortest duration, s.
        least_s: u64,
    },
    /// A helper process ended or printed an unexpected line.
    #[error("the helper process `{helper}` {reason}")]
    Helper {
        /// The work of the helper.
        helper: String,
        /// The fault.
        reason: String,
    },
    /// A file cannot be read or written.
    #[error("cannot use {path}: {source}", path = path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The system error.
        source: io::Error,
    },
    /// The transport.
    #[error(transparent)]
    Stage(#[from] StageError),
    /// A request to stop.
    #[error("interrupted")]
    Interrupted,
    /// A helper was called with unknown arguments.
    #[error("{0}")]
    Usage(String),
}

impl StressError {
    /// Returns a function that names the file of a system error.
    pub(crate) fn file(path: impl Into<PathBuf>) -> impl FnOnce(io::Error) -> Self {
        let path = path.into();
        move |source| Self::File { path, source }
    }
}
