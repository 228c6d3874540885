//! Errors of datasets. Each message names the fault, its place and the remedy.

use std::path::PathBuf;

use super::format::Format;
use super::image_size::ImageSize;
use gyre_radar::scan::ScanError;

/// A dataset that cannot be opened.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages explain the variants and fields")]
pub enum OpenError {
    #[error("there is no dataset at {path}: no such folder; check the path")]
    Missing { path: PathBuf },
    #[error(
        "{path} is a file: give the folder of the dataset, which holds the radar images or their folder, or a recording or bag of ROS 2 as MCAP"
    )]
    NotAFolder { path: PathBuf },
    #[error("{path} is {kind}: {remedy}")]
    Foreign {
        path: PathBuf,
        kind: &'static str,
        remedy: &'static str,
    },
    #[error(
        "{path} looks like {found}, but the configuration says `format = \"{configured}\"`: use a configuration of {found}, or none"
    )]
    OtherFormat {
        path: PathBuf,
        found: Format,
        configured: Format,
    },
    #[error(
        "{path} holds no PNG images: the dataset is not downloaded or unpacked, or the path is one level off"
    )]
    NoImages { path: PathBuf },
    #[error(
        "{path} is not a known dataset: {reason}; known are {}: {remedy}",
        known()
    )]
    UnknownLayout {
        path: PathBuf,
        reason: String,
        remedy: &'static str,
    },
    /// An option that is out of bounds, or does not apply to the format.
    #[error("{key} = {value} is invalid{}: {reason}", .format.map_or_else(String::new, |it| format!(" for the format {it}")))]
    BadOption {
        key: &'static str,
        value: String,
        format: Option<Format>,
        reason: &'static str,
    },
    #[error("{path}, line {line}: {reason}")]
    Text {
        path: PathBuf,
        line: usize,
        reason: String,
    },
    /// The list of the times of images that have none of their own is missing.
    #[error(
        "there is no {path}: it lists the times of the images, which have none of their own; copy it from the dataset"
    )]
    NoTimes { path: PathBuf },
    #[error(
        "{path} has no times of {missing} of {images} images, {first} first; every image needs a line `Frame: <number> Time: <seconds>.<nanoseconds>`: copy the whole list, or take these images away"
    )]
    MissingTimes {
        path: PathBuf,
        missing: usize,
        images: usize,
        first: String,
    },
    #[error("cannot read {path}: {source}")]
    Io {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("{path} does not hold keys of the section [dataset]: {reason}")]
    DatasetToml { path: PathBuf, reason: String },
    /// The first image, which determines the size of all scans, cannot be read.
    #[error("the size of the scans is unknown, since the first image cannot be read: {0}")]
    FirstImage(#[from] ReadError),
    #[error("{0}")]
    Recording(String),
    #[error("{path} is {actual}, not a {format} image: {reason}")]
    WrongImage {
        path: PathBuf,
        actual: ImageSize,
        format: Format,
        reason: String,
    },
}

/// A scan that cannot be read. Other scans may be readable.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages explain the variants and fields")]
pub enum ReadError {
    #[error("scan {index} does not exist: the dataset has {len} scans")]
    NoSuchScan { index: usize, len: usize },
    #[error("cannot read {path}: {source}")]
    Io {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("{path} has no scan {index}: the run did not read it, or the recorder missed it")]
    NotRecorded { path: PathBuf, index: usize },
    #[error("{path} is not a PNG image")]
    NotPng { path: PathBuf },
    #[error("{path} is truncated after {bytes} bytes; copy or download it again")]
    Truncated { path: PathBuf, bytes: usize },
    #[error("{path} is corrupt: {reason}; copy or download it again")]
    Damaged { path: PathBuf, reason: String },
    #[error("{path} has {actual} pixels instead of 8-bit grey: it was converted from the original")]
    WrongPixels { path: PathBuf, actual: String },
    #[error("{path} is {actual}, but most images of the dataset are {expected}{}", transposed(.actual, .expected))]
    WrongSize {
        path: PathBuf,
        actual: ImageSize,
        expected: ImageSize,
    },
    #[error("{path} is too large for a radar scan: {actual} bytes, at most {limit} are accepted")]
    TooLarge {
        path: PathBuf,
        actual: u64,
        limit: u64,
    },
    #[error("the slot holds {actual} {what}, but this scan needs {needed}")]
    SlotTooSmall {
        what: &'static str,
        needed: usize,
        actual: usize,
    },
    #[error(
        "{path}, row {row}: encoder count {count} exceeds {counts} counts per turn; set `encoder_counts`, or `azimuth_source = \"uniform\"`"
    )]
    EncoderCount {
        path: PathBuf,
        row: usize,
        count: u16,
        counts: u16,
    },
    #[error(
        "{path}, row {row}: azimuth does not increase (encoder count {count} after {previous}); the rows are not one sweep"
    )]
    AzimuthOrder {
        path: PathBuf,
        row: usize,
        count: u16,
        previous: u16,
    },
    #[error(
        "{path}: no row is in {gap_deg:.0} degrees of the turn, for an encoder of {counts} counts per turn: the image holds a part of a turn, or `encoder_counts` is another number"
    )]
    NotATurn {
        path: PathBuf,
        gap_deg: f64,
        counts: u16,
    },
    #[error(
        "{path}, row {row}: stamp {value} is not a time of the years 2015 to 2040 in s, ms, us or ns: the first 11 bytes of the row are not Navtech metadata"
    )]
    StampYear {
        path: PathBuf,
        row: usize,
        value: i64,
    },
    #[error("{path}, {fault}")]
    Times { path: PathBuf, fault: ScanError },
    /// Stamps that are far from the time in the name of the file.
    #[error(
        "{path}: stamps of its rows are {apart_s:.1} s from the time in its name, which other files agree with: the clock was set, or the file has another scan's name"
    )]
    NameTime { path: PathBuf, apart_s: f64 },
    #[error("the message of scan {index} in {path} cannot be decoded: {reason}")]
    Message {
        path: PathBuf,
        index: usize,
        reason: String,
    },
}

impl ReadError {
    /// Returns whether the file cannot be read, as opposed to a file with invalid content: it may
    /// be readable at another time. A file that is missing counts too, because it was there when
    /// the dataset was opened.
    pub fn is_io(&self) -> bool {
        matches!(self, Self::Io { .. })
    }
}

/// Returns what can be read.
fn known() -> String {
    let formats = Format::ALL.map(Format::name).join(", ");
    format!("{formats}, and as MCAP recordings of runs and bags of ROS 2")
}

fn transposed(actual: &ImageSize, expected: &ImageSize) -> &'static str {
    if actual.width == expected.height
        && actual.height == expected.width
        && actual.width != actual.height
    {
        ": it is rotated by 90 degrees"
    } else {
        ""
    }
}
