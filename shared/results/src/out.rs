//! The folder of results, which one command at a time may change.

use std::{
    fs::File,
    io,
    path::{Path, PathBuf},
};

use gyre_storage::{
    create_folder,
    lock::{Attempt, try_lock},
};
use thiserror::Error;

/// The lock of the folder. It lies beside the results and not in shared memory, which two runs need
/// not have in common: containers have their own.
const LOCK: &str = ".lock";

/// Why a folder cannot be that of the results.
#[derive(Debug, Error)]
pub enum OutError {
    /// It cannot be written.
    #[error("cannot write to {path}: {source}", path = path.display())]
    Unwritable {
        /// The folder.
        path: PathBuf,
        /// The system error.
        source: io::Error,
    },
    /// Another run, map or localisation is writing to it.
    #[error("another command is writing to {path}{holder}: wait for it, or choose another --out", path = path.display())]
    Held {
        /// The folder.
        path: PathBuf,
        /// The process, where the system tells: `, process 123 (gyre)`.
        holder: String,
    },
}

/// The folder of the results, locked for this command while it lives.
#[derive(Debug)]
pub struct Out {
    path: PathBuf,
    _lock: File,
}

/// Returns the full name of a folder of results, which need not exist yet.
///
/// # Errors
/// The system does not tell the working directory.
pub fn absolute(out: &Path) -> io::Result<PathBuf> {
    out.canonicalize().or_else(|_| std::path::absolute(out))
}

impl Out {
    /// Creates and locks the folder. Nothing else in it is changed.
    ///
    /// # Errors
    /// A folder that cannot be written, or to which another command is writing.
    pub fn lock(path: &Path) -> Result<Self, OutError> {
        let unwritable = |source| OutError::Unwritable {
            path: path.to_owned(),
            source,
        };
        create_folder(path).map_err(|error| unwritable(error.source))?;
        let path = path.canonicalize().map_err(unwritable)?;
        match try_lock(&path.join(LOCK)).map_err(unwritable)? {
            Attempt::Locked(lock) => Ok(Self { path, _lock: lock }),
            Attempt::Held(holder) => Err(OutError::Held {
                path,
                holder: holder.map_or(String::new(), |holder| format!(", {holder}")),
            }),
        }
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
