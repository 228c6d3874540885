//! The folder of the results, which one run at a time may change.

use std::{
    fs::{self, File},
    path::{Path, PathBuf},
};

use gyre_stage::lock::{Attempt, try_lock};

use crate::Failure;

/// The lock of the folder. It lies beside the results and not in shared memory, which two runs need not have in common:
/// containers have their own.
const LOCK: &str = ".lock";

/// The folder of the results, locked for this run while it lives.
#[derive(Debug)]
pub struct Out {
    path: PathBuf,
    _lock: File,
}

impl Out {
    /// Creates and locks the folder. Nothing else in it is changed.
    ///
    /// # Errors
    /// A folder that cannot be written, or to which another run is writing.
    pub fn lock(path: &Path) -> Result<Self, Failure> {
        let unwritable =
            |error: std::io::Error| format!("cannot write to {}: {error}", path.display());
        fs::create_dir_all(path).map_err(unwritable)?;
        let path = path.canonicalize().map_err(unwritable)?;
        let holder = match try_lock(&path.join(LOCK)).map_err(unwritable)? {
            Attempt::Locked(lock) => return Ok(Self { path, _lock: lock }),
            Attempt::Held(holder) => holder.map_or(String::new(), |holder| format!(", {holder}")),
        };
        Err(format!(
            "another run is writing to {}{holder}: wait for it, or choose another --out",
            path.display()
        )
        .into())
    }

    /// Returns the absolute path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the path of a file in the folder.
    pub fn join(&self, name: impl AsRef<Path>) -> PathBuf {
        self.path.join(name)
    }
}
