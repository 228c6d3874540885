//! Errors of generating a dataset.

use std::path::PathBuf;

use gyre_datasets::TrajectoryError;
use gyre_storage::StorageError;

/// The reason why a dataset could not be set up or written.
#[derive(Debug, thiserror::Error)]
pub enum SimulatorError {
    /// A value of [`crate::SimulationConfig`] cannot be simulated.
    #[error("simulation key `{key}` is {value}, but it must be {expected}")]
    Config {
        /// The key as written in a configuration.
        key: &'static str,
        /// The given value.
        value: String,
        /// The values that are allowed.
        expected: String,
    },
    /// The trajectory file cannot be read.
    #[error(transparent)]
    Trajectory(#[from] TrajectoryError),
    /// No vehicle can drive along the poses of a trajectory file.
    #[error("cannot drive along {}: {reason}", path.display())]
    Drive {
        /// The file.
        path: PathBuf,
        /// The reason.
        reason: String,
    },
    /// More scans are wanted than the drive lasts.
    #[error(
        "`simulation.scans` is {scans}, but the drive ends after {most} scans ({duration_s:.1} s): take at most so many, or leave the key out"
    )]
    TooManyScans {
        /// The scans that are wanted.
        scans: usize,
        /// The scans of the whole drive.
        most: usize,
        /// The duration of the drive, seconds.
        duration_s: f64,
    },
    /// The drive leaves the streets of the town.
    #[error(
        "the drive leaves the streets of `simulation.town.streets` {at_s:.1} s after its start: add its trajectory to them"
    )]
    OffStreets {
        /// The time, seconds after the start of the drive.
        at_s: f64,
    },
    /// The output folder holds files of another dataset.
    #[error("{} holds `{other}`, which is no file of this dataset: choose an empty folder", folder.display())]
    OutputInUse {
        /// The folder.
        folder: PathBuf,
        /// The first foreign file.
        other: String,
    },
    /// The output folder holds a dataset of another configuration.
    #[error("{} holds a dataset of another configuration (see its simulation.toml): choose another folder", folder.display())]
    OtherDataset {
        /// The folder.
        folder: PathBuf,
    },
    /// An existing image differs from the rendered one.
    #[error("{} differs from the image that is rendered now: another build made it, or it was changed; choose another folder", path.display())]
    OtherImage {
        /// The image.
        path: PathBuf,
    },
    /// Another process writes to the output folder.
    #[error("another process is writing to {}: wait for it, or choose another folder", folder.display())]
    Busy {
        /// The folder.
        folder: PathBuf,
    },
    /// A file could not be written.
    #[error(transparent)]
    Storage(#[from] StorageError),
    /// A file or folder could not be written.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The path.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// A folder could not be listed.
    #[error("cannot list {}: {source}", folder.display())]
    List {
        /// The folder.
        folder: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// An image could not be encoded.
    #[error("cannot encode {}: {source}", path.display())]
    Encode {
        /// The image.
        path: PathBuf,
        /// The encoder's error.
        source: png::EncodingError,
    },
}

impl SimulatorError {
    /// Adds the path to an input or output error.
    pub(crate) fn write(path: &std::path::Path) -> impl FnOnce(std::io::Error) -> Self + '_ {
        move |source| Self::Write {
            path: path.to_owned(),
            source,
        }
    }
}
