//! Errors of logs. Each message says what is wrong, where, and what to do.

use std::{io, path::PathBuf};

use crate::OpenError;
use thiserror::Error;

/// A log that cannot be used.
#[derive(Debug, Error)]
pub enum GnssLogError {
    /// No log beside the scans.
    #[error(
        "no log of a GNSS receiver lies beside the scans in {folder}: name one with gnss.kind = \"log\" and gnss.file, or set gnss.kind = \"none\""
    )]
    None {
        /// The folder of the dataset.
        folder: PathBuf,
    },
    /// A file that cannot be read.
    #[error("cannot read the log of the GNSS receiver {path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: io::Error,
    },
    /// A table that has no fixes.
    #[error("{path} is no log of a GNSS receiver: {reason}")]
    Unknown {
        /// The file.
        path: PathBuf,
        /// The finding, and the remedy.
        reason: String,
    },
    /// A log whose fixes cannot be used.
    #[error("the log of the GNSS receiver {path} cannot be used: {reason}")]
    Unusable {
        /// The file.
        path: PathBuf,
        /// The finding, and the remedy.
        reason: String,
    },
    /// No fixes in a bag, and no log beside it.
    #[error(
        "the bag {bag} has no messages of sensor_msgs/msg/NavSatFix, and no log of a GNSS receiver lies beside it: name one with gnss.kind = \"log\" and gnss.file, or set gnss.kind = \"none\""
    )]
    NoneInBag {
        /// The bag.
        bag: PathBuf,
    },
    /// A topic of scans that are in no bag.
    #[error(
        "gnss.topic is {topic}, but {data} is no bag of ROS 2: remove it, and the log beside the scans is used"
    )]
    NoBag {
        /// The topic.
        topic: String,
        /// The scans.
        data: PathBuf,
    },
    /// A bag, or the list of the times of RADIATE's files.
    #[error(transparent)]
    Open(#[from] OpenError),
}
