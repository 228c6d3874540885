//! Files that people have of a recording before it is unpacked or converted, by their first bytes.

use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};

use super::error::OpenError;

/// Bytes that identify the type of a file: the signature of a tar archive is the last of them.
const HEAD_BYTES: u64 = 512;

type Kind = (usize, &'static [u8], &'static str);

const BAG: &str = "a bag of ROS 1: convert it with `rosbags-convert --src FILE --dst FOLDER --dst-storage mcap` (pip install rosbags), and name that folder";
const DATABASE: &str = "an SQLite database, as bags of ROS 2 may be: convert it with `ros2 bag convert` and `storage_id: mcap`";
const ARCHIVE: &str = "an archive, or compressed: unpack it, and name the folder that it held";
const KINDS: [Kind; 10] = [
    (0, b"#ROSBAG V", BAG),
    (0, b"SQLite format 3\0", DATABASE),
    // ZIP, tar, gzip, bzip2, xz, Zstandard, 7z and RAR.
    (0, b"PK\x03\x04", ARCHIVE),
    (257, b"ustar", ARCHIVE),
    (0, b"\x1f\x8b", ARCHIVE),
    (0, b"BZh", ARCHIVE),
    (0, b"\xfd7zXZ\0", ARCHIVE),
    (0, b"\x28\xb5\x2f\xfd", ARCHIVE),
    (0, b"7z\xbc\xaf\x27\x1c", ARCHIVE),
    (0, b"Rar!\x1a\x07", ARCHIVE),
];

/// Returns an error that names the type of the file, if it is one of these.
pub(crate) fn foreign(path: &Path) -> Option<OpenError> {
    let mut head = Vec::new();
    let file = gyre_storage::open(path).ok()?;
    file.take(HEAD_BYTES).read_to_end(&mut head).ok()?;
    let has = |(at, signature, _): &&Kind| {
        let bytes = head.get(*at..);
        bytes.is_some_and(|bytes| bytes.starts_with(signature))
    };
    let (.., kind) = KINDS.iter().find(has)?;
    Some(OpenError::at(path, format_args!("is {kind}")))
}

pub(crate) fn foreign_in(folder: &Path) -> Option<OpenError> {
    let entries = fs::read_dir(folder).ok()?.flatten();
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
    files.sort_unstable();
    files.iter().find_map(|file| foreign(file))
}
