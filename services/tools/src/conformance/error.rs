//! The error of a test or a comparison.

use std::{io, path::Path};

use gyre_stage::StageError;
use gyre_supervise::SuperviseError;
use thiserror::Error;

/// Why a program could not be tested or compared.
#[derive(Debug, Error)]
pub enum ProgramError {
    /// A process or the transport.
    #[error(transparent)]
    Supervise(#[from] SuperviseError),
    /// The inputs cannot be computed.
    #[error("cannot compute the inputs: our own {stage} ended: {reason}")]
    Own { stage: &'static str, reason: String },
    /// Too few scans.
    #[error(
        "{0} scans are too few to test a stage with: name a recording of more, or raise --scans"
    )]
    TooFew(usize),
    /// A signal asked for the end.
    #[error("interrupted")]
    Interrupted,
    /// The rows of `shadow.csv` cannot be written.
    #[error("cannot write shadow.csv: {0}")]
    Rows(#[from] csv::Error),
    /// The report cannot be written.
    #[error("cannot write shadow.json: {0}")]
    Report(#[from] serde_json::Error),
}

impl ProgramError {
    pub(crate) fn file(path: &Path) -> impl FnOnce(io::Error) -> Self + use<> {
        let path = path.to_owned();
        move |source| StageError::File { path, source }.into()
    }
}

impl From<StageError> for ProgramError {
    fn from(error: StageError) -> Self {
        Self::Supervise(error.into())
    }
}
