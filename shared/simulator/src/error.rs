//! What can go wrong when a dataset is generated.

use std::path::PathBuf;

use gyre_radar::TrajectoryError;

/// Why a dataset could not be set up or written.
#[derive(Debug, thiserror::Error)]
pub enum SimulatorError {
    /// A key of [`crate::SimulationConfig`] has a value that cannot be simulated.
    #[error("simulation key `{key}` is {value}, but it must be {expected}")]
    Config {
        /// The key as written in a configuration.
        key: &'static str,
        /// The value that was given.
        value: String,
        /// What would do.
        expected: String,
    },
    /// The trajectory to drive along cannot be read.
    #[error(transparent)]
    Trajectory(#[from] TrajectoryError),
    /// A trajectory that can be read cannot be driven.
    #[error("cannot drive along {}: {reason}", path.display())]
    Drive {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// The output folder holds what is of another dataset; a mixture of both would be read as one.
    #[error("{} holds `{other}`, which is not of this dataset: give an empty folder", folder.display())]
    OutputInUse {
        /// The folder.
        folder: PathBuf,
        /// The first file that does not belong.
        other: String,
    },
    /// The output folder holds a recording of another configuration.
    #[error("{} holds a recording of another configuration (its simulation.toml says which): give another folder", folder.display())]
    OtherRecording {
        /// The folder.
        folder: PathBuf,
    },
    /// An image that is to be kept is not the one that would be written.
    #[error("{} is not what would be written now: another build made it, or it was changed; give another folder", path.display())]
    OtherImage {
        /// The image.
        path: PathBuf,
    },
    /// Two at once would mix.
    #[error("another process is writing to {}: wait for it, or give another folder", folder.display())]
    Busy {
        /// The folder.
        folder: PathBuf,
    },
    /// A file or folder could not be written.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// What was to be written.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A folder could not be listed.
    #[error("cannot list {}: {source}", folder.display())]
    List {
        /// The folder.
        folder: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// An image could not be encoded.
    #[error("cannot encode {}: {source}", path.display())]
    Encode {
        /// The image.
        path: PathBuf,
        /// What the encoder said.
        source: png::EncodingError,
    },
}

impl SimulatorError {
    /// Wraps an input or output error with the path that it is about.
    pub(crate) fn write(path: &std::path::Path) -> impl FnOnce(std::io::Error) -> Self + '_ {
        move |source| Self::Write {
            path: path.to_owned(),
            source,
        }
    }
}
