//! The error of a shadow.

use std::{io, path::Path};

use gyre_harness::SuperviseError;
use gyre_stage::StageError;
use thiserror::Error;

/// Why there is no comparison.
#[derive(Debug, Error)]
pub enum ShadowError {
    /// The run cannot be observed, or the transport fails.
    #[error(transparent)]
    Stage(#[from] StageError),
    /// The program cannot be started.
    #[error(transparent)]
    Supervise(#[from] SuperviseError),
    /// The rows of `shadow.csv` cannot be written.
    #[error("cannot write shadow.csv: {0}")]
    Rows(csv::Error),
    /// The report cannot be written.
    #[error("cannot write shadow.json: {0}")]
    Report(#[from] serde_json::Error),
}

impl ShadowError {
    pub(crate) fn file(path: &Path) -> impl FnOnce(io::Error) -> Self + use<> {
        let path = path.to_owned();
        move |source| StageError::File { path, source }.into()
    }
}
