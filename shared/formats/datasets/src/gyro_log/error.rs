//! Errors of logs. Each message says what is wrong, where, and what to do.

use std::{io, path::PathBuf};

use crate::OpenError;
use gyre_samples::SampleKind;
use thiserror::Error;

/// The log of the INS that Boreas' ground truth was computed from.
pub(super) const IN_TRUTH: &str = "applanix/imu.csv";

/// A log that cannot be used.
#[derive(Debug, Error)]
pub enum LogError {
    /// No log beside the scans.
    #[error(
        "no log of {} lies beside the scans in {folder}: name one with {section}.kind = \"log\" and {section}.file, or set {section}.kind = \"none\"",
        one(*of),
        section = of.section()
    )]
    None {
        /// The sensor whose log is missing.
        of: SampleKind,
        /// The folder of the dataset.
        folder: PathBuf,
    },
    /// The only log is that of the ground truth.
    #[error(
        "the only log beside the scans is {path}, of which the ground truth was computed, so that an evaluation with it says little: name it in gyro.file if it is to be used all the same"
    )]
    InTruth {
        /// The log.
        path: PathBuf,
    },
    /// A live sensor beside scans of a recording.
    #[error(
        "{}.kind is that of a live sensor, but the scans are of a recording: set it to `auto`, `log` or `none`",
        .0.section()
    )]
    Live(SampleKind),
    /// A file that cannot be read.
    #[error("cannot read the log of the {} {path}: {source}", of.section())]
    Io {
        /// The sensor.
        of: SampleKind,
        /// The file.
        path: PathBuf,
        /// The cause.
        source: io::Error,
    },
    /// A table that is no log of this sensor.
    #[error("{path} is no log of {}: {reason}", one(*of))]
    Unknown {
        /// The sensor.
        of: SampleKind,
        /// The file.
        path: PathBuf,
        /// The finding, and the remedy.
        reason: String,
    },
    /// A log whose stamps or values cannot be those of the sensor.
    #[error("the log of the {} {path} cannot be used: {reason}", of.section())]
    Unusable {
        /// The sensor.
        of: SampleKind,
        /// The file.
        path: PathBuf,
        /// The finding, and the remedy.
        reason: String,
    },
    /// A log of another time than the scans.
    #[error(
        "the log of the {section} {path} has no sample while the scans were measured: it begins {after_s:.1} s after the first of them. {steps}It is of another drive, or {section}.late_s is wrong",
        section = of.section()
    )]
    Elsewhere {
        /// The sensor.
        of: SampleKind,
        /// The log.
        path: PathBuf,
        /// From the first scan to its first sample, s.
        after_s: f64,
        /// The steps of its clock, if there are any: sentences with a space behind.
        steps: String,
    },
    /// The list of the times of RADIATE's files.
    #[error(transparent)]
    List(#[from] OpenError),
}

/// A sensor of this kind, in words.
fn one(of: SampleKind) -> &'static str {
    match of {
        SampleKind::Gyro => "a gyro",
        SampleKind::Wheels => "the wheels",
    }
}
