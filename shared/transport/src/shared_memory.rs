//! The file system of all shared memory.

use rustix::fs::statvfs;

pub const SHARED_MEMORY: &str = "/dev/shm";

/// Returns the bytes of shared memory that are free; `None` if they are not limited.
pub fn free_shared_memory() -> rustix::io::Result<Option<u64>> {
    let there = statvfs(SHARED_MEMORY)?;
    Ok((there.f_blocks > 0).then_some(there.f_bavail * there.f_frsize))
}

pub(crate) fn is_full() -> bool {
    free_shared_memory().is_ok_and(|free| free == Some(0))
}
