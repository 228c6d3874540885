//! Why a link fails.

use std::path::Path;

use gyre_journal::JournalError;
use gyre_stage::StageError;
use gyre_supervise::SuperviseError;
use thiserror::Error;

use crate::NetworkError;

#[derive(Debug, Error)]
pub enum LinkError {
    #[error("link: {0}")]
    Network(#[from] NetworkError),
    #[error("cannot {action}: {reason}")]
    Zenoh { action: String, reason: String },
    #[error("{0}")]
    Refused(String),
    #[error(transparent)]
    Stage(#[from] StageError),
    #[error(transparent)]
    Supervise(#[from] SuperviseError),
    #[error(transparent)]
    Journal(#[from] JournalError),
}

impl LinkError {
    pub(crate) fn other_version(other: &str) -> Self {
        Self::Refused(format!(
            "{other} is another version of gyre: install the same on both"
        ))
    }

    pub(crate) fn file(path: &Path, source: &std::io::Error) -> Self {
        Self::Refused(format!("{}: {source}", path.display()))
    }

    pub(crate) fn zenoh(action: &str, error: &dyn std::fmt::Display) -> Self {
        // zenoh appends the place in its sources.
        let text = error.to_string();
        let reason = text.split(" at /").next().unwrap_or_default().to_owned();
        Self::Zenoh {
            action: action.to_owned(),
            reason,
        }
    }
}

impl From<LinkError> for StageError {
    fn from(error: LinkError) -> Self {
        match error {
            LinkError::Stage(error) => error,
            LinkError::Zenoh { .. } => Self::Transient(error.to_string()),
            _ => Self::Input(error.to_string()),
        }
    }
}
