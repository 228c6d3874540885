//! Errors of datasets. Each message says what is wrong, where, and what to do.

use std::path::PathBuf;

use super::format::Format;
use super::image_size::ImageSize;
use gyre_radar::scan::ScanError;

/// A dataset that cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The path does not exist.
    #[error("there is no dataset at {path}: no such folder; check the path")]
    Missing {
        /// The path.
        path: PathBuf,
    },
    /// The path is a file.
    #[error(
        "{path} is a file: give the folder of the dataset, which holds the radar images or their folder, or a recording or bag of ROS 2 as MCAP"
    )]
    NotAFolder {
        /// The path.
        path: PathBuf,
    },
    /// A file that is to be unpacked or converted first.
    #[error("{path} is {kind}: {remedy}")]
    Foreign {
        /// The file.
        path: PathBuf,
        /// The kind of the file.
        kind: &'static str,
        /// The command or the step that is needed.
        remedy: &'static str,
    },
    /// A dataset of another format than the configuration says.
    #[error(
        "{path} looks like {found}, but the configuration says `format = \"{configured}\"`: use a configuration of {found}, or none"
    )]
    OtherFormat {
        /// The dataset's root.
        path: PathBuf,
        /// The format that it looks like.
        found: Format,
        /// The format that is configured.
        configured: Format,
    },
    /// A folder without radar images.
    #[error(
        "{path} holds no PNG images: the dataset is not downloaded or unpacked, or the path is one level off"
    )]
    NoImages {
        /// The folder.
        path: PathBuf,
    },
    /// A layout of folders and images that no reader knows.
    #[error(
        "{path} is not a known dataset: {reason}; known are {}: {remedy}",
        known()
    )]
    UnknownLayout {
        /// The dataset's root.
        path: PathBuf,
        /// The finding.
        reason: String,
        /// The remedy.
        remedy: &'static str,
    },
    /// An option that is out of bounds, or does not apply to the format.
    #[error("{key} = {value} is invalid{}: {reason}", .format.map_or_else(String::new, |it| format!(" for the format {it}")))]
    BadOption {
        /// The key.
        key: &'static str,
        /// The value.
        value: String,
        /// The format, if only that has no use for it.
        format: Option<Format>,
        /// The permitted values.
        reason: &'static str,
    },
    /// A text file of the dataset (stamps) that cannot be parsed.
    #[error("{path}, line {line}: {reason}")]
    Text {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// The problem, and what is expected.
        reason: String,
    },
    /// The list of the times of images that have none of their own is missing.
    #[error(
        "there is no {path}: it lists the times of the images, which have none of their own; copy it from the dataset"
    )]
    NoTimes {
        /// The list.
        path: PathBuf,
    },
    /// Images that the list of times does not have.
    #[error(
        "{path} has no times of {missing} of {images} images, {first} first; every image needs a line `Frame: <number> Time: <seconds>.<nanoseconds>`: copy the whole list, or take these images away"
    )]
    MissingTimes {
        /// The list.
        path: PathBuf,
        /// Images without a time.
        missing: usize,
        /// Number of images.
        images: usize,
        /// The name of the first image without a time.
        first: String,
    },
    /// A file or folder that cannot be read.
    #[error("cannot read {path}: {source}")]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// A `dataset.toml` that cannot be parsed.
    #[error("{path} does not hold keys of the section [dataset]: {reason}")]
    DatasetToml {
        /// The file.
        path: PathBuf,
        /// The problem.
        reason: String,
    },
    /// The first image, which determines the size of all scans, cannot be read.
    #[error("the size of the scans is unknown, since the first image cannot be read: {0}")]
    FirstImage(#[from] ReadError),
    /// A recording of a run, which is no folder of images.
    #[error("{0}")]
    Recording(String),
    /// Images that do not match the format.
    #[error("{path} is {actual}, not a {format} image: {reason}")]
    WrongImage {
        /// The first image.
        path: PathBuf,
        /// The size.
        actual: ImageSize,
        /// The format.
        format: Format,
        /// The requirement of the format.
        reason: String,
    },
}

/// A scan that cannot be read. Other scans may be readable.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// An index past the end.
    #[error("scan {index} does not exist: the dataset has {len} scans")]
    NoSuchScan {
        /// The index, from 0.
        index: usize,
        /// Number of scans.
        len: usize,
    },
    /// A file that cannot be read.
    #[error("cannot read {path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// A scan that a recording of a run lacks.
    #[error("{path} has no scan {index}: the run did not read it, or the recorder missed it")]
    NotRecorded {
        /// The recording.
        path: PathBuf,
        /// The scan, from 0.
        index: usize,
    },
    /// A file without the signature of a PNG.
    #[error("{path} is not a PNG image")]
    NotPng {
        /// The file.
        path: PathBuf,
    },
    /// A truncated file.
    #[error("{path} is truncated after {bytes} bytes; copy or download it again")]
    Truncated {
        /// The file.
        path: PathBuf,
        /// Bytes present.
        bytes: usize,
    },
    /// A corrupt file.
    #[error("{path} is corrupt: {reason}; copy or download it again")]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The decoder's message.
        reason: String,
    },
    /// An image that is not 8-bit grey.
    #[error("{path} has {actual} pixels instead of 8-bit grey: it was converted from the original")]
    WrongPixels {
        /// The file.
        path: PathBuf,
        /// Bit depth and colour type.
        actual: String,
    },
    /// An image of another size than the others.
    #[error("{path} is {actual}, but most images of the dataset are {expected}{}", transposed(.actual, .expected))]
    WrongSize {
        /// The file.
        path: PathBuf,
        /// The size.
        actual: ImageSize,
        /// The size of most images.
        expected: ImageSize,
    },
    /// An image or file that is larger than any radar scan.
    #[error("{path} is too large for a radar scan: {actual} bytes, at most {limit} are accepted")]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Size of the file or the image, bytes.
        actual: u64,
        /// Maximum size, bytes.
        limit: u64,
    },
    /// A slot that is smaller than the limits of the dataset.
    #[error("the slot holds {actual} {what}, but this scan needs {needed}")]
    SlotTooSmall {
        /// The slice of the slot.
        what: &'static str,
        /// Elements needed.
        needed: usize,
        /// Elements present.
        actual: usize,
    },
    /// An encoder count beyond one turn.
    #[error(
        "{path}, row {row}: encoder count {count} exceeds {counts} counts per turn; set `encoder_counts`, or `azimuth_source = \"uniform\"`"
    )]
    EncoderCount {
        /// The file.
        path: PathBuf,
        /// The row of the image, from 0.
        row: usize,
        /// The count.
        count: u16,
        /// Counts per turn.
        counts: u16,
    },
    /// An azimuth that does not increase.
    #[error(
        "{path}, row {row}: azimuth does not increase (encoder count {count} after {previous}); the rows are not one sweep"
    )]
    AzimuthOrder {
        /// The file.
        path: PathBuf,
        /// The row of the image, from 0.
        row: usize,
        /// The encoder count.
        count: u16,
        /// The encoder count of the previous row.
        previous: u16,
    },
    /// Rows that are only a part of a turn.
    #[error(
        "{path}: no row is in {gap_deg:.0} degrees of the turn, for an encoder of {counts} counts per turn: the image holds a part of a turn, or `encoder_counts` is another number"
    )]
    NotATurn {
        /// The file.
        path: PathBuf,
        /// The widest angle without a row, degrees.
        gap_deg: f64,
        /// Counts per turn.
        counts: u16,
    },
    /// A stamp outside the years of radar recordings.
    #[error(
        "{path}, row {row}: stamp {value} is not a time of the years 2015 to 2040 in s, ms, us or ns: the first 11 bytes of the row are not Navtech metadata"
    )]
    StampYear {
        /// The file.
        path: PathBuf,
        /// The row of the image, from 0.
        row: usize,
        /// The stamp as stored.
        value: i64,
    },
    /// Stamps that are not of one sweep.
    #[error("{path}, {fault}")]
    Times {
        /// The file.
        path: PathBuf,
        /// The row and what is wrong with it.
        fault: ScanError,
    },
    /// Stamps that are far from the time in the name of the file.
    #[error(
        "{path}: stamps of its rows are {apart_s:.1} s from the time in its name, which other files agree with: the clock was set, or the file has another scan's name"
    )]
    NameTime {
        /// The file.
        path: PathBuf,
        /// Time of the scan minus that by its name, s.
        apart_s: f64,
    },
    /// A message that is not of its type, or not of powers.
    #[error("the message of scan {index} in {path} cannot be decoded: {reason}")]
    Message {
        /// The file.
        path: PathBuf,
        /// The scan, from 0.
        index: usize,
        /// The problem.
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
