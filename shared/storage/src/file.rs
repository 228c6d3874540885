//! Files that are changed in place.

use std::{
    fs::{self, OpenOptions, TryLockError},
    io,
    os::unix::fs::{FileExt, MetadataExt},
    path::{Path, PathBuf},
    sync::atomic::{AtomicBool, Ordering},
    thread,
    time::{Duration, Instant},
};

#[cfg(feature = "record")]
use crate::record::{self, Operation};
use crate::{
    StorageError,
    folder::sync_folder,
    lock::{self, Attempt, try_lock_existing},
};

/// Time for which a lock is tried, and between two attempts.
const LOCK_WAIT: Duration = Duration::from_secs(1);
const LOCK_PAUSE: Duration = Duration::from_millis(5);

/// True if a full disk is no error of this process, and from when it was full.
static CONTINUES: AtomicBool = AtomicBool::new(false);
static IS_FULL: AtomicBool = AtomicBool::new(false);

/// Lets this process continue when the disk is full: nothing that it changes in place is kept from
/// then on, because its files may not have gaps.
pub fn continue_when_full() {
    CONTINUES.store(true, Ordering::Relaxed);
}

/// Returns whether the disk was full since [`continue_when_full`].
pub fn was_full() -> bool {
    IS_FULL.load(Ordering::Relaxed)
}

fn is_full(error: &io::Error) -> bool {
    use io::ErrorKind::{FileTooLarge, QuotaExceeded, StorageFull};
    matches!(error.kind(), StorageFull | QuotaExceeded | FileTooLarge)
}

#[derive(Debug)]
pub struct File {
    path: PathBuf,
    file: fs::File,
}

impl File {
    /// Opens a file to read and change it, or creates it. The name of a new one survives a power
    /// failure.
    pub fn open_or_create(path: &Path) -> Result<Self, StorageError> {
        let failed = StorageError::at("write", path);
        let mut options = OpenOptions::new();
        options.read(true).write(true);
        let file = match options.open(path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                let created = options.create(true).truncate(false).open(path);
                let file = created.map_err(failed)?;
                #[cfg(feature = "record")]
                record::push(path, || Operation::Create(path.to_owned()));
                path.parent().map_or(Ok(()), sync_folder)?;
                file
            }
            opened => opened.map_err(failed)?,
        };
        Ok(Self {
            path: path.to_owned(),
            file,
        })
    }

    /// Creates an empty file and locks it, in place of any other of this name; `None` if that is
    /// locked.
    pub(crate) fn create(path: &Path) -> Result<Option<Self>, StorageError> {
        let left_over = try_lock_existing(path);
        match &left_over {
            Ok(Attempt::Held(_)) => return Ok(None),
            // Another process may create it by now: it is not removed.
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            // Not truncated: another name may lead to the same content. The lock is held meanwhile.
            _ => crate::remove(path)?,
        }
        let created = OpenOptions::new().create_new(true).write(true).open(path);
        let file = match created {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => return Ok(None),
            created => created.map_err(StorageError::at("write", path))?,
        };
        // Until now another process might take it for one that was left over. A file system without
        // locks has none.
        if let Ok(Attempt::Held(_)) = lock::attempt(&file, path) {
            return Ok(None);
        }
        #[cfg(feature = "record")]
        record::push(path, || Operation::Create(path.to_owned()));
        Ok(Some(Self {
            path: path.to_owned(),
            file,
        }))
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    pub fn try_clone(&self) -> Result<Self, StorageError> {
        let file = self.file.try_clone();
        Ok(Self {
            path: self.path.clone(),
            file: file.map_err(StorageError::at("read", &self.path))?,
        })
    }

    /// Locks the file for this process, and waits up to a second for one that was killed and is not
    /// gone yet: it keeps its lock until the system has closed its files. False if another process
    /// keeps the lock.
    pub fn lock(&self) -> Result<bool, StorageError> {
        let since = Instant::now();
        loop {
            match self.file.try_lock() {
                Ok(()) => return Ok(true),
                Err(TryLockError::WouldBlock) if since.elapsed() < LOCK_WAIT => {
                    thread::sleep(LOCK_PAUSE);
                }
                Err(TryLockError::WouldBlock) => return Ok(false),
                Err(TryLockError::Error(source)) => {
                    return Err(StorageError::at("lock", &self.path)(source));
                }
            }
        }
    }

    /// Checks that the file still has its name. Without it no other process finds the written data.
    pub fn require_name(&self) -> Result<(), StorageError> {
        let failed = StorageError::at("keep", &self.path);
        let id = |metadata: fs::Metadata| (metadata.dev(), metadata.ino());
        let own = self.file.metadata().map(id).map_err(&failed)?;
        match fs::metadata(&self.path).map(id) {
            Ok(named) if named == own => Ok(()),
            Err(error) if error.kind() != io::ErrorKind::NotFound => Err(failed(error)),
            _ => Err(failed(io::Error::other(
                "another program has removed or replaced it while it was written, and what it held is lost",
            ))),
        }
    }

    pub fn length(&self) -> Result<u64, StorageError> {
        let metadata = self.file.metadata();
        let metadata = metadata.map_err(StorageError::at("read", &self.path))?;
        Ok(metadata.len())
    }

    /// Fills `bytes` from `offset` on; false if the file ends before.
    pub fn read_at(&self, bytes: &mut [u8], offset: u64) -> Result<bool, StorageError> {
        match self.file.read_exact_at(bytes, offset) {
            Ok(()) => Ok(true),
            Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => Ok(false),
            Err(error) => Err(StorageError::at("read", &self.path)(error)),
        }
    }

    fn unless_full(&self, done: io::Result<()>, action: &'static str) -> Result<(), StorageError> {
        match done {
            Err(error) if is_full(&error) && CONTINUES.load(Ordering::Relaxed) => {
                IS_FULL.store(true, Ordering::Relaxed);
                Ok(())
            }
            done => done.map_err(StorageError::at(action, &self.path)),
        }
    }

    /// Writes `bytes` at `offset`. A process that is killed meanwhile has written a first part of
    /// them.
    /// A full disk is not an error after [`continue_when_full`].
    pub fn write_at(&self, bytes: &[u8], offset: u64) -> Result<(), StorageError> {
        if was_full() {
            return Ok(());
        }
        self.unless_full(self.file.write_all_at(bytes, offset), "write")?;
        #[cfg(feature = "record")]
        if !was_full() {
            record::push(&self.path, || Operation::Write {
                path: self.path.clone(),
                offset,
                bytes: bytes.to_vec(),
            });
        }
        Ok(())
    }

    /// Cuts the file, or extends it by zeros.
    pub fn set_length(&self, length: u64) -> Result<(), StorageError> {
        let set = self.file.set_len(length);
        set.map_err(StorageError::at("write", &self.path))?;
        #[cfg(feature = "record")]
        record::push(&self.path, || Operation::SetLength {
            path: self.path.clone(),
            length,
        });
        Ok(())
    }

    /// Cuts off the bytes behind `end`, if there are any.
    pub fn cut_to(&self, end: u64) -> Result<(), StorageError> {
        match self.length()? > end {
            true => self.set_length(end),
            false => Ok(()),
        }
    }

    /// Makes all that was written before survive a power failure.
    /// After an error the lost data are unknown, and a second attempt does not reveal the loss.
    pub fn sync(&self) -> Result<(), StorageError> {
        #[cfg(feature = "record")]
        let id = record::sync_begins(&self.path);
        self.unless_full(self.file.sync_data(), "synchronise")?;
        #[cfg(feature = "record")]
        record::push(&self.path, || Operation::SyncEnds {
            path: self.path.clone(),
            id,
        });
        Ok(())
    }
}
