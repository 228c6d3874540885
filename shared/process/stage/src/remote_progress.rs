//! The progress of stages on another machine. While those owe something, nobody here does: the
//! supervisor reads it before it looks for a stall.

use std::{
    fs::{File, OpenOptions},
    os::unix::fs::{FileExt, OpenOptionsExt},
    path::PathBuf,
};

use crate::{Manifest, StageError};

/// The name of the file in the run's root: one more than `Item::published` of the newest item that
/// was handed over, eight bytes, little-endian.
const FILE: &str = "elsewhere";
/// Written until the other machine has reported where it continues.
const UNKNOWN: u64 = u64::MAX;

/// Writes the progress of the hand-over.
pub(crate) struct ProgressWriter {
    path: PathBuf,
    file: File,
}

impl ProgressWriter {
    /// Begins without the other machine.
    pub fn create(manifest: &Manifest) -> Result<Self, StageError> {
        let path = manifest.root.join(FILE);
        let opened = OpenOptions::new()
            .create(true)
            .truncate(false)
            .write(true)
            .mode(0o600)
            .open(&path);
        let file = opened.map_err(|source| StageError::File {
            path: path.clone(),
            source,
        })?;
        let writer = Self { path, file };
        writer.write(UNKNOWN)?;
        Ok(writer)
    }

    /// So many items were handed over, counted at the source.
    pub fn has_published(&self, items: u64) -> Result<(), StageError> {
        self.write(items)
    }

    fn write(&self, items: u64) -> Result<(), StageError> {
        let written = self.file.write_all_at(&items.to_le_bytes(), 0);
        written.map_err(|source| StageError::File {
            path: self.path.clone(),
            source,
        })
    }
}

/// Returns whether stages on another machine owe the pose of an item that was handed over to them,
/// after so many poses.
pub fn owes(manifest: &Manifest, poses: u64) -> bool {
    let mut bytes = [0; 8];
    let read =
        File::open(manifest.root.join(FILE)).and_then(|file| file.read_exact_at(&mut bytes, 0));
    read.is_ok() && u64::from_le_bytes(bytes) > poses
}
