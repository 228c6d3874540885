//! Checks whether a program keeps the contract of a stage, which is in `docs/replace-a-stage.md`.
//!
//! The program runs alone, in runs of its own, as the supervisor would start it. This process is all the rest of such a run: it feeds
//! the program what Gyre's own stages made of some scans, and examines what it sends.
//!
//! Reading order: [`Rule`] (what is checked), [`check`], `checks` (the scenarios), `session` (one process under test), `tape` (the
//! inputs), `malformed` (inputs that must be refused).
//!
//! [`content`] (what of a message is a result), [`copying`] (what an item has of its input) and [`topology`] (the topics of each stage)
//! are for others too that run a stage alone.

mod checks;
pub mod content;
pub mod copying;
mod malformed;
mod report;
mod rule;
mod session;
mod subject;
mod tape;
pub mod topology;

use std::{io, path::PathBuf};

use gyre_stage::{StageError, wake::Signals};
use gyre_supervise::SuperviseError;
use thiserror::Error;

pub use report::{Report, Work};
pub use rule::{Rule, Verdict};
pub use subject::{Demands, Prepare, Scans, Subject};
pub use tape::start_of_trajectory;

use checks::Examination;
use tape::Tape;

/// Why a program could not be tested.
#[derive(Debug, Error)]
pub enum ConformanceError {
    /// A process or the transport.
    #[error(transparent)]
    Supervise(#[from] SuperviseError),
    /// A file or a folder.
    #[error("{path}: {source}")]
    File {
        /// The path.
        path: PathBuf,
        /// The system error.
        source: io::Error,
    },
    /// The inputs cannot be computed.
    #[error("cannot compute the inputs: our own {stage} ended: {reason}")]
    Own {
        /// The stage.
        stage: &'static str,
        /// The reason.
        reason: String,
    },
    /// Too few scans.
    #[error(
        "{0} scans are too few to test a stage with: name a recording of more, or raise --scans"
    )]
    TooFew(usize),
    /// A signal asked for the end.
    #[error("interrupted")]
    Interrupted,
}

impl From<StageError> for ConformanceError {
    fn from(error: StageError) -> Self {
        Self::Supervise(error.into())
    }
}

/// Tests a program with inputs from these scans; `observe` receives what is tested.
///
/// # Errors
/// The inputs cannot be computed, the program cannot be started, or the transport fails. A program that breaks the contract is no
/// error: the report says so.
pub fn check(
    subject: &Subject,
    mut scans: Scans,
    signals: &Signals,
    observe: &mut dyn FnMut(&str),
) -> Result<Report, ConformanceError> {
    observe("the inputs, by our own stages");
    let tape = Tape::record(subject, &mut scans, signals)?;
    Examination::new(subject, &tape, signals, observe).run()
}
