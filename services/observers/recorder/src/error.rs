//! Errors of a recording.

use std::path::PathBuf;

use gyre_recording::RecordingError;
use gyre_stage::StageError;
use thiserror::Error;

#[derive(Debug, Error)]
pub enum RecorderError {
    #[error(transparent)]
    Stage(#[from] StageError),
    #[error("cannot record: {0}; the run continues without a recording")]
    Recording(#[from] RecordingError),
    #[error("{0} exists, and a recording is never overwritten: name another file, or remove it")]
    Exists(PathBuf),
    #[error(
        "there is no topic `{0}`: there are scan, masked, rotation, motion, refined, pose, loop, correction, fix, log and health"
    )]
    NoTopic(String),
    #[error("the thread that writes the recording has ended")]
    Thread,
}

impl RecorderError {
    /// Returns the exit code of the process: whether another start may help.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Stage(error) => error.exit_code(),
            Self::Thread => StageError::TRANSIENT,
            _ => StageError::PERMANENT,
        }
    }
}
