//! Errors of datasets. Each message names the fault, its place and the remedy.

use std::{
    fmt::Display,
    io,
    path::{Path, PathBuf},
};

use super::format::Format;

#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// An option that is out of bounds, or does not apply to the format.
    #[error("{key} = {value} is invalid{}: {reason}", .format.map_or_else(String::new, |it| format!(" for the format {it}")))]
    BadOption {
        key: &'static str,
        value: String,
        format: Option<Format>,
        reason: &'static str,
    },
    #[error("cannot read {path}: {source}")]
    Io { path: PathBuf, source: io::Error },
    /// The first image, which determines the size of all scans, cannot be read.
    #[error("the size of the scans is unknown, since the first image cannot be read: {0}")]
    FirstImage(#[from] ReadError),
    /// Any other fault: a sentence.
    #[error("{0}")]
    Recording(String),
}

impl OpenError {
    pub fn option(
        format: Option<Format>,
        key: &'static str,
        value: impl Display,
        reason: &'static str,
    ) -> Self {
        let value = value.to_string();
        Self::BadOption {
            key,
            value,
            format,
            reason,
        }
    }

    pub(crate) fn io(path: &Path, source: io::Error) -> Self {
        let path = path.to_owned();
        Self::Io { path, source }
    }

    /// Any other fault of a file or a folder, in words that follow its path.
    pub(crate) fn at(path: &Path, fault: impl Display) -> Self {
        Self::Recording(format!("{} {fault}", path.display()))
    }

    pub(crate) fn no_images(path: &Path) -> Self {
        let fault = "holds no PNG images: the dataset is not downloaded or unpacked, or the path is one level off";
        Self::at(path, fault)
    }

    pub(crate) fn unknown_layout(path: &Path, reason: &str, remedy: &str) -> Self {
        let formats = Format::OF_IMAGES.iter().map(|format| format.name());
        let formats = formats.collect::<Vec<_>>().join(", ");
        let known = format!("{formats}, and as MCAP recordings of runs and bags of ROS 2");
        let fault = format!("is not a known dataset: {reason}; known are {known}: {remedy}");
        Self::at(path, fault)
    }
}

#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    #[error("scan {index} does not exist: the dataset has {len} scans")]
    NoSuchScan { index: usize, len: usize },
    #[error("cannot read {path}: {source}")]
    Io { path: PathBuf, source: io::Error },
    #[error("{path} is corrupt: {reason}; copy or download it again")]
    Damaged { path: PathBuf, reason: String },
    /// Any other fault: a sentence.
    #[error("{0}")]
    Scan(String),
}

impl ReadError {
    pub(crate) fn io(path: &Path, source: io::Error) -> Self {
        let path = path.to_owned();
        Self::Io { path, source }
    }

    /// A fault of an image, in words that follow its path at once.
    pub(crate) fn image(path: &Path, fault: impl Display) -> Self {
        Self::Scan(format!("{}{fault}", path.display()))
    }

    pub(crate) fn row(path: &Path, row: usize, fault: impl Display) -> Self {
        Self::image(path, format!(", row {row}: {fault}"))
    }

    /// Returns whether the file cannot be read, as opposed to a file with invalid content: it may
    /// be readable at another time. A file that is missing counts too, because it was there when
    /// the dataset was opened.
    pub fn is_io(&self) -> bool {
        matches!(self, Self::Io { .. })
    }
}
