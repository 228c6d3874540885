//! What can go wrong when a dataset is generated.

use std::path::PathBuf;

/// Why a simulation could not be set up or written.
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
    /// The output folder holds scans of another dataset; a mixture of both would be read as one.
    #[error("{} holds `{other}`, which this simulation would not write: give an empty folder", folder.display())]
    OutputInUse {
        /// The folder of images.
        folder: PathBuf,
        /// The first file that does not belong.
        other: String,
    },
    /// A file or folder could not be written.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// What was to be written.
        path: PathBuf,
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
        move |source| Self::Write { path: path.to_owned(), source }
    }
}
