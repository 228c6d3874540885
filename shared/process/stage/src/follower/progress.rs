//! The progress of a follower, a file in the run's root. The supervisor reads it to learn whether
//! the follower has come to its end, which no exit code shows: a follower that was asked to end
//! exits as well.

use std::{
    fs::{File, OpenOptions},
    os::unix::fs::{FileExt, OpenOptionsExt},
    path::PathBuf,
};

use crate::{Manifest, StageError};

/// The position of a follower.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Progress {
    /// Records that it has worked on.
    pub done: u64,
    pub total: u64,
}

/// The length of the file: [`Progress::done`], [`Progress::total`] and 1 at the end of the logs,
/// each as eight bytes, little-endian.
const LENGTH: usize = 24;

pub(super) struct ProgressWriter {
    path: PathBuf,
    file: File,
    written: [u8; LENGTH],
}

impl ProgressWriter {
    pub fn create(manifest: &Manifest, follower: &str) -> Result<Self, StageError> {
        let path = path(manifest, follower);
        let opened = OpenOptions::new()
            .create(true)
            .truncate(false)
            .write(true)
            .mode(0o600)
            .open(&path);
        Ok(Self {
            file: opened.map_err(|source| StageError::File {
                path: path.clone(),
                source,
            })?,
            path,
            written: [0; LENGTH],
        })
    }

    pub fn write(&mut self, progress: Progress, has_ended: bool) -> Result<(), StageError> {
        let bytes = to_bytes(progress, has_ended);
        if bytes == self.written {
            return Ok(());
        }
        self.written = bytes;
        let written = self.file.write_all_at(&bytes, 0);
        written.map_err(|source| StageError::File {
            path: self.path.clone(),
            source,
        })
    }
}

/// Returns the progress of a follower and whether it has come to its end; `None` before its first
/// step.
pub fn read(manifest: &Manifest, follower: &str) -> Option<(Progress, bool)> {
    let mut bytes = [0; LENGTH];
    let file = File::open(path(manifest, follower)).ok()?;
    file.read_exact_at(&mut bytes, 0).ok()?;
    Some(from_bytes(bytes))
}

/// Returns whether a follower has come to the end of its logs.
pub fn is_done(manifest: &Manifest, follower: &str) -> bool {
    read(manifest, follower).is_some_and(|(_, has_ended)| has_ended)
}

fn path(manifest: &Manifest, follower: &str) -> PathBuf {
    manifest.root.join(format!("{follower}.progress"))
}

fn to_bytes(progress: Progress, has_ended: bool) -> [u8; LENGTH] {
    let mut bytes = [0; LENGTH];
    let numbers = [progress.done, progress.total, u64::from(has_ended)];
    for (place, number) in bytes.chunks_exact_mut(8).zip(numbers) {
        place.copy_from_slice(&number.to_le_bytes());
    }
    bytes
}

fn from_bytes(bytes: [u8; LENGTH]) -> (Progress, bool) {
    let [done, total, ended] = [0, 8, 16].map(|at| {
        let mut number = [0; 8];
        number.copy_from_slice(&bytes[at..at + 8]);
        u64::from_le_bytes(number)
    });
    (Progress { done, total }, ended == 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_progress_is_read_as_it_was_written() {
        let progress = Progress {
            done: 120,
            total: 1 << 40,
        };
        for has_ended in [false, true] {
            assert_eq!(
                from_bytes(to_bytes(progress, has_ended)),
                (progress, has_ended)
            );
        }
    }
}
