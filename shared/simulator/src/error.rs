use std::fmt::Display;

use gyre_datasets::TrajectoryError;
use gyre_storage::StorageError;

#[derive(Debug, thiserror::Error)]
pub enum SimulatorError {
    /// The configuration cannot be simulated, the folder is in use, or an image cannot be encoded.
    #[error("{0}")]
    Refused(String),
    /// The output folder holds something else than this dataset.
    #[error("{0}")]
    OtherFiles(String),
    #[error(transparent)]
    Trajectory(#[from] TrajectoryError),
    #[error(transparent)]
    Storage(#[from] StorageError),
}

impl SimulatorError {
    /// A value of a key of [`crate::SimulationConfig`] that cannot be simulated.
    pub(crate) fn key(key: &str, value: impl Display, expected: impl Display) -> Self {
        Self::Refused(format!(
            "simulation key `{key}` is {value}, but it must be {expected}"
        ))
    }
}
