//! The error of a test.

use gyre_stage::StageError;
use gyre_supervise::SuperviseError;
use thiserror::Error;

/// Why a program could not be tested.
#[derive(Debug, Error)]
pub enum ConformanceError {
    /// A process or the transport.
    #[error(transparent)]
    Supervise(#[from] SuperviseError),
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
