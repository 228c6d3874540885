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
mod limited;
pub mod lock;
mod log;
mod quoted;
#[cfg(feature = "record")]
pub mod record;
mod records;
pub mod shipped;

use std::{
    io,
    path::{Path, PathBuf},
};

use thiserror::Error;

pub use draft::{Draft, is_draft, write};
pub use durable::{Busy, DurableFile, Slots, is_sealed, seal};
pub use file::{File, continue_when_full, was_full};
pub use folder::{create_folder, remove, rename, sync_folder};
pub use group_sync::GroupSync;
pub use limited::{SETTINGS, open, read_bytes, read_text};
pub use log::{LogError, LogMagic};
pub use quoted::quoted;
pub use records::{Record, RecordLog, RecordReader, records_path};

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
}
