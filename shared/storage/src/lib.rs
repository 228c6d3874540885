//! Files that are whole after a kill and after a power failure: replaced as a whole ([`Draft`]), or
//! changed in place and synchronised in the background ([`DurableFile`], [`RecordLog`]). Also
//! locks, and readers of files of unknown origin: no pipes or devices, and up to a size.
//!
//! A file and its name are two things: the name of a new or renamed file is safe once its folder is
//! synchronised. All data that must survive are written through this crate, so that a test can
//! record each change (feature `record`) and replay the possible states after a power failure.

mod draft;
mod durable;
mod file;
mod folder;
mod group_sync;
mod held;
mod limited;
pub mod lock;
mod log;
mod quoted;
#[cfg(feature = "record")]
pub mod record;
mod records;
pub mod shipped;

use std::{
    fs::OpenOptions,
    io,
    path::{Path, PathBuf},
};

use rustix::fs::{FallocateFlags, fallocate};
use thiserror::Error;

pub use draft::{Draft, is_draft, write};
pub use durable::{Busy, DurableFile, Slots, is_sealed, seal};
pub use file::File;
pub use folder::{create_folder, remove, rename, sync_folder};
pub use group_sync::GroupSync;
pub use held::{Disk, continue_when_full, disk, was_full};
pub use limited::{SETTINGS, open, read_bytes, read_text};
pub use log::{LogError, LogMagic};
pub use quoted::quoted;
pub use records::{Record, RecordLog, RecordReader, records_path};

/// The free bytes of a disk where it counts as having room again.
const ROOM: u64 = 16 << 20;

#[must_use]
pub fn is_full(error: &io::Error) -> bool {
    use io::ErrorKind::{FileTooLarge, QuotaExceeded, StorageFull};
    matches!(error.kind(), StorageFull | QuotaExceeded | FileTooLarge)
}

/// Returns whether the disk of a folder, which was full, has room again, also within the quota of
/// the user.
#[must_use]
pub fn has_room(folder: &Path) -> bool {
    free_bytes(folder).is_none_or(|bytes| bytes >= ROOM)
        && !matches!(take_room(folder), Err(error) if is_full(&error))
}

/// Takes the room for a moment. An error of another kind than a full disk answers nothing: not all
/// file systems can do it.
fn take_room(folder: &Path) -> io::Result<()> {
    let path = folder.join(".room.tmp");
    let file = OpenOptions::new().create(true).append(true).open(&path)?;
    let taken = fallocate(&file, FallocateFlags::empty(), 0, ROOM);
    let _ = std::fs::remove_file(&path);
    Ok(taken?)
}

/// Returns the bytes that a user may still write to the disk of a folder.
#[must_use]
pub fn free_bytes(folder: &Path) -> Option<u64> {
    let disk = rustix::fs::statvfs(folder).ok()?;
    Some(disk.f_bavail.saturating_mul(disk.f_frsize))
}

#[derive(Debug, Error)]
#[error("cannot {action} {}: {source}", path.display())]
pub struct StorageError {
    /// The operation: `read`, `write`, `keep`, `synchronise`, `rename`, `remove`.
    pub action: &'static str,
    pub path: PathBuf,
    pub source: io::Error,
}

impl StorageError {
    pub fn at(action: &'static str, path: &Path) -> impl Fn(io::Error) -> Self {
        move |source| Self {
            action,
            path: path.to_owned(),
            source,
        }
    }

    /// Returns whether the disk is full, or the user's part of it.
    #[must_use]
    pub fn is_full(&self) -> bool {
        is_full(&self.source)
    }
}
