//! Generations of numbers.
//!
//! In live mode masking numbers the scans that it takes. When it is started again it gives the
//! numbers behind the newest pose to other scans, and what had been sent under them is void; a
//! sensor's source does so when the run is started again. Each such start begins a generation,
//! which its messages carry. So whoever looks on, or reads a recording, can tell a scan that has
//! taken the number of another one from one that is sent again.

use std::{
    io,
    path::{Path, PathBuf},
};

use gyre_messages::Item;
use gyre_storage::StorageError;

use crate::{Manifest, StageError};

/// The largest file of a generation, bytes.
const MAX_BYTES: u64 = 64;

/// The generation of the numbers of a process.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Generation {
    number: u32,
    first: u64,
}

impl Generation {
    /// Begins a generation that gives its numbers from `first` on. The number of the generation is
    /// kept beside the journal and survives a power failure, so that none is given twice.
    ///
    /// # Errors
    /// The file of the generation cannot be read or written.
    pub fn begin(manifest: &Manifest, newest_pose: &Item, first: u64) -> Result<Self, StageError> {
        let path = Self::path(&manifest.out);
        let before = read(&path)?.max(newest_pose.generation);
        let number = before.saturating_add(1);
        let folder = path.parent().map_or(Ok(()), gyre_storage::create_folder);
        folder
            .and_then(|()| gyre_storage::write(&path, number.to_string()))
            .map_err(|StorageError { path, source, .. }| StageError::File { path, source })?;
        Ok(Self { number, first })
    }

    /// Returns the file that keeps the number of the last generation.
    pub fn path(out: &Path) -> PathBuf {
        out.join("journal").join("generation")
    }

    /// Writes it into the item of a message.
    pub fn mark(&self, item: &mut Item) {
        (item.generation, item.numbered_from) = (self.number, self.first);
    }
}

/// Reads the number of the last generation; 0 before the first.
fn read(path: &Path) -> Result<u32, StageError> {
    match gyre_storage::read_text(path, MAX_BYTES) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(0),
        Err(source) => Err(StageError::File {
            path: path.to_owned(),
            source,
        }),
        Ok(text) => text.trim().parse().map_err(|_| {
            StageError::Input(format!(
                "{} holds no number: remove it if nobody needs a recording of this run any more",
                path.display()
            ))
        }),
    }
}
