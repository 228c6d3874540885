//! A record of all changes below a folder, for tests that replay power failures.

use std::{
    path::{Path, PathBuf},
    sync::{
        Mutex, MutexGuard, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
};

#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Operation {
    CreateFolder(PathBuf),
    Create(PathBuf),
    Write {
        path: PathBuf,
        offset: u64,
        bytes: Vec<u8>,
    },
    SetLength {
        path: PathBuf,
        length: u64,
    },
    SyncBegins {
        path: PathBuf,
        id: u64,
    },
    /// It has ended: writes before its begin survive.
    SyncEnds {
        path: PathBuf,
        id: u64,
    },
    Rename {
        from: PathBuf,
        to: PathBuf,
    },
    Remove(PathBuf),
    /// The names in a folder survive from here on.
    SyncFolder(PathBuf),
}

/// Records the changes below a folder while it lives, by all threads of this process.
#[derive(Debug)]
pub struct Recorder(PathBuf);

/// The roots of recorders, and the changes below each.
static RECORDINGS: Mutex<Vec<(PathBuf, Vec<Operation>)>> = Mutex::new(Vec::new());

fn recordings() -> MutexGuard<'static, Vec<(PathBuf, Vec<Operation>)>> {
    RECORDINGS.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Recorder {
    pub fn start(root: &Path) -> Self {
        recordings().push((root.to_owned(), Vec::new()));
        Self(root.to_owned())
    }

    pub fn operations(&self) -> Vec<Operation> {
        let all = recordings();
        let ours = all.iter().find(|(root, _)| *root == self.0);
        ours.map_or(Vec::new(), |(_, operations)| operations.clone())
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        recordings().retain(|(root, _)| *root != self.0);
    }
}

pub(crate) fn push(path: &Path, operation: impl Fn() -> Operation) {
    for (root, operations) in recordings().iter_mut() {
        if path.starts_with(root) {
            operations.push(operation());
        }
    }
}

pub(crate) fn sync_begins(path: &Path) -> u64 {
    static IDS: AtomicU64 = AtomicU64::new(0);
    let id = IDS.fetch_add(1, Ordering::Relaxed);
    push(path, || Operation::SyncBegins {
        path: path.to_owned(),
        id,
    });
    id
}
