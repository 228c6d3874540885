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

/// Allocates the segment of the publisher with this id. A dead process may have left memory that is
/// about to be freed.
pub(crate) fn reserve(manifest: &Manifest, topic: &str, publisher: u128) -> Result<(), StageError> {
    let suffix = format!("_{publisher}.data");
    let (path, segment) = run::own_files(Path::new(SHARED_MEMORY), &manifest.prefix)
        .find(|(path, _)| path.to_string_lossy().ends_with(&suffix))
        .ok_or_else(|| StageError::transport(format!("find the memory of {topic}"), publisher))?;
    let file = File::options().write(true).open(path);
    let allocated = file.and_then(|file| {
        let whole = fallocate(&file, FallocateFlags::empty(), 0, segment.len());
        whole.map_err(Into::into)
    });
    allocated.map_err(|error| {
        StageError::Transient(format!(
            "shared memory at {SHARED_MEMORY} has no room for the {:.1} MB of topic `{topic}` ({error}): free some, enlarge it \
             (containers: --shm-size), or lower run.window or raster.n",
            segment.len() as f64 / 1e6
        ))
    })
}
