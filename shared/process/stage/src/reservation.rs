//! Reserves the shared memory of a publisher before its first message.
//!
//! The transport creates segments without memory, and a first write to a page without memory kills
//! the process. So all pages are allocated when a publisher is created, and a shortage is an error.

use std::{fs::File, path::Path};

use rustix::fs::{FallocateFlags, fallocate};

use crate::{
    Manifest, StageError,
    run::{self, SHARED_MEMORY},
};

/// Allocates the segment of the publisher with this id.
pub(crate) fn reserve(
    manifest: &Manifest,
    topic: &'static str,
    publisher: u128,
) -> Result<(), StageError> {
    let suffix = format!("_{publisher}.data");
    let (path, segment) = run::own_files(Path::new(SHARED_MEMORY), &manifest.prefix)
        .find(|(path, _)| path.to_string_lossy().ends_with(&suffix))
        .ok_or_else(|| StageError::transport(format!("find the memory of {topic}"), publisher))?;
    let full = |source: std::io::Error| StageError::NoMemory {
        topic,
        megabytes: segment.len() as f64 / 1e6,
        source,
    };
    let file = File::options().write(true).open(path).map_err(full)?;
    fallocate(&file, FallocateFlags::empty(), 0, segment.len()).map_err(|error| full(error.into()))
}
