//! What can go wrong with a dataset: one clear sentence each, saying what, where and what to do.

use std::path::PathBuf;

use super::format::Format;
use super::image_size::ImageSize;

/// A dataset that cannot be opened at all.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// Nothing is there.
    #[error("there is no dataset at {path}: no such folder; check the path")]
    Missing {
        /// The path that was asked for.
        path: PathBuf,
    },
    /// A file where a folder must be.
    #[error(
        "{path} is a file: name the dataset's folder, the one that holds the radar images or their folder"
    )]
    NotAFolder {
        /// The path that was asked for.
        path: PathBuf,
    },
    /// A folder without radar images.
    #[error(
        "{path} holds no PNG images: nothing was downloaded or unpacked there, or the path is one level off"
    )]
    NoImages {
        /// The folder where the images should be.
        path: PathBuf,
    },
    /// Images or folders of a layout that no reader knows.
    #[error(
        "{path} is not a dataset that Gyre knows: {reason}; if it is one, say which with `format`"
    )]
    UnknownLayout {
        /// The dataset's root.
        path: PathBuf,
        /// What was found or looked for.
        reason: String,
    },
    /// An option with an impossible value, or one that the format has no use for.
    #[error("{key} = {value} is not possible for a {format} dataset: {reason}")]
    BadOption {
        /// The option's key.
        key: &'static str,
        /// Its value, as given.
        value: String,
        /// The dataset's format, or "any".
        format: String,
        /// What would be possible.
        reason: &'static str,
    },
    /// A text file of the dataset (stamps) that cannot be understood.
    #[error("{path}, line {line}: {reason}")]
    Text {
        /// The file.
        path: PathBuf,
        /// The line, from 1; 0 where the file as a whole is meant.
        line: usize,
        /// What is wrong and what was expected.
        reason: String,
    },
    /// A file or folder that the system would not give.
    #[error("cannot read {path}: {source}")]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// A `dataset.toml` that cannot be understood.
    #[error(
        "{path} should say how the recording is to be read, with the keys of [dataset]: {reason}"
    )]
    Told {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// The first image cannot serve: it says how large all scans are.
    #[error("the first image does not say how large the scans are: {0}")]
    FirstImage(#[from] ReadError),
    /// Images that are not what the format demands.
    #[error("{path} is {actual}, not a {format} image: {reason}")]
    WrongImage {
        /// The first image.
        path: PathBuf,
        /// Its size.
        actual: ImageSize,
        /// The format.
        format: Format,
        /// What the format demands.
        reason: String,
    },
}

/// One scan that cannot be read; the scans beside it may be good.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// An index past the end.
    #[error("scan {index} was asked for, and the dataset has {len}")]
    NoSuchScan {
        /// The scan asked for, from 0.
        index: usize,
        /// Scans in the dataset.
        len: usize,
    },
    /// A file that the system would not give.
    #[error("cannot read {path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// A file that does not start as a PNG does.
    #[error("{path} is not a PNG image")]
    NotPng {
        /// The file.
        path: PathBuf,
    },
    /// A file that ends too early.
    #[error(
        "{path} is cut short: its {bytes} bytes end before the image does; copy or download it again"
    )]
    Truncated {
        /// The file.
        path: PathBuf,
        /// Bytes that are there.
        bytes: usize,
    },
    /// A file whose content is damaged.
    #[error("{path} is damaged: {reason}; copy or download it again")]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The decoder's reason.
        reason: String,
    },
    /// An image that is not 8-bit grey.
    #[error("{path} has {actual} pixels where 8-bit grey is needed; it was converted on the way")]
    WrongPixels {
        /// The file.
        path: PathBuf,
        /// Colour type and bits.
        actual: String,
    },
    /// An image unlike the first.
    #[error("{path} is {actual}, and the dataset's first image is {expected}{}", turned(.actual, .expected))]
    WrongSize {
        /// The file.
        path: PathBuf,
        /// Its size.
        actual: ImageSize,
        /// The first image's size.
        expected: ImageSize,
    },
    /// An image or file larger than any radar's.
    #[error("{path} is too large for a radar scan: {actual} bytes, and at most {limit} are read")]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Its size in bytes (of the file or of its image).
        actual: u64,
        /// The most that is accepted.
        limit: u64,
    },
    /// Memory to fill that is smaller than the dataset's limits say.
    #[error("the slot has room for {actual} {what}, and this scan needs {needed}")]
    SlotTooSmall {
        /// Which of the slot's slices.
        what: &'static str,
        /// Elements needed.
        needed: usize,
        /// Elements there.
        actual: usize,
    },
    /// An encoder count that the encoder cannot give.
    #[error(
        "{path}, row {row}: encoder count {count} is above the encoder's {counts} counts a turn; set `encoder_counts`, or `azimuth_source = \"uniform\"`"
    )]
    EncoderCount {
        /// The file.
        path: PathBuf,
        /// The image's row, from 0.
        row: usize,
        /// The count found.
        count: u16,
        /// Counts of a turn.
        counts: u16,
    },
    /// An azimuth that does not follow the one before.
    #[error(
        "{path}, row {row}: azimuth does not grow (encoder count {count} after {previous}); the rows are not one sweep"
    )]
    AzimuthOrder {
        /// The file.
        path: PathBuf,
        /// The image's row, from 0.
        row: usize,
        /// The encoder count found.
        count: u16,
        /// The row before's.
        previous: u16,
    },
    /// A stamp that is no time at which a radar ran.
    #[error(
        "{path}, row {row}: stamp {value} is not in the years 2015 to 2040 in s, ms, us or ns; the first 11 bytes of a row are not what they should be"
    )]
    StampYear {
        /// The file.
        path: PathBuf,
        /// The image's row, from 0.
        row: usize,
        /// The stamp as stored.
        value: i64,
    },
    /// Stamps that jump within a sweep.
    #[error(
        "{path}: its first and last rows are {span_s:.3} s apart, which is not one sweep; the clock was set in between"
    )]
    SweepTime {
        /// The file.
        path: PathBuf,
        /// Last row's stamp less the first's, s.
        span_s: f64,
    },
}

fn turned(actual: &ImageSize, expected: &ImageSize) -> &'static str {
    if actual.width == expected.height
        && actual.height == expected.width
        && actual.width != actual.height
    {
        ": it lies rotated by 90 degrees"
    } else {
        ""
    }
}
