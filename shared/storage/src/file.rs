//! Files that are changed in place.

use std::{
    fs::{self, OpenOptions, TryLockError},
    io,
    os::unix::fs::{FileExt, MetadataExt},
    path::{Path, PathBuf},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    thread,
    time::{Duration, Instant},
};

#[cfg(feature = "record")]
use crate::record::{self, Operation};
use crate::{
    StorageError,
    folder::sync_folder,
    held::{Held, is_lost, lose, unless_full},
    lock::{self, Attempt, try_lock_existing},
};

/// Time for which a lock is tried, and between two attempts.
const LOCK_WAIT: Duration = Duration::from_secs(1);
const LOCK_PAUSE: Duration = Duration::from_millis(5);

/// Writes that are made at once when a full disk has room again: half as many as may be in danger
/// of a power failure ([`GroupSync`](crate::GroupSync)). They survive one before the next are made.
const BATCH: usize = 16;

#[derive(Debug)]
pub struct File {
    path: PathBuf,
    file: fs::File,
    /// The writes that wait for room on the disk; `None`: a full disk is an error.
    held: Option<Arc<Mutex<Held>>>,
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
            held: Some(Arc::default()),
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
            held: None,
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
            held: self.held.clone(),
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

    /// Writes `bytes` at `offset`. A process that is killed meanwhile has written a first part of
    /// them. After [`continue_when_full`](crate::continue_when_full) a full disk is not an error.
    pub fn write_at(&self, bytes: &[u8], offset: u64) -> Result<(), StorageError> {
        self.write_held()?;
        let Some(mut held) = self.held() else {
            return self.write_now(bytes, offset);
        };
        let may_write = held.is_empty() && !is_lost();
        if !(may_write && unless_full(self.write_now(bytes, offset))?) {
            held.push(offset, bytes);
        }
        Ok(())
    }

    fn write_now(&self, bytes: &[u8], offset: u64) -> Result<(), StorageError> {
        let written = self.file.write_all_at(bytes, offset);
        written.map_err(StorageError::at("write", &self.path))?;
        #[cfg(feature = "record")]
        record::push(&self.path, || Operation::Write {
            path: self.path.clone(),
            offset,
            bytes: bytes.to_vec(),
        });
        Ok(())
    }

    fn held(&self) -> Option<MutexGuard<'_, Held>> {
        let held = self.held.as_ref()?;
        Some(held.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Returns whether writes wait for room on the disk.
    pub(crate) fn is_behind(&self) -> bool {
        self.held().is_some_and(|held| !held.is_empty())
    }

    /// Writes some of what waits; returns whether there was room.
    fn write_held(&self) -> Result<bool, StorageError> {
        let held = self.held().filter(|it| !it.is_empty() && it.is_due());
        let Some(mut held) = held else {
            return Ok(false);
        };
        let mut is_full = false;
        for _ in 0..BATCH {
            let Some((offset, bytes)) = held.front().filter(|_| !is_full) else {
                break;
            };
            match unless_full(self.write_now(bytes, offset))? {
                true => held.pop(),
                false => is_full = true,
            }
        }
        held.note_attempt(is_full);
        self.sync()?;
        Ok(!is_full)
    }

    /// Writes all that waits, as far as there is room now.
    pub(crate) fn write_all_held(&self) -> Result<(), StorageError> {
        if let Some(mut held) = self.held() {
            held.note_attempt(false);
        }
        while self.write_held()? {}
        Ok(())
    }

    /// Cuts the file, or extends it by zeros. Writes that wait behind its new end are dropped.
    pub fn set_length(&self, length: u64) -> Result<(), StorageError> {
        if let Some(mut held) = self.held() {
            held.cut(length);
        }
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
        let synchronised = self.file.sync_data();
        let synchronised = synchronised.map_err(StorageError::at("synchronise", &self.path));
        if self.held.is_none() {
            synchronised?;
        } else if !unless_full(synchronised)? {
            // What is lost of the file is unknown.
            lose();
        }
        #[cfg(feature = "record")]
        record::push(&self.path, || Operation::SyncEnds {
            path: self.path.clone(),
            id,
        });
        Ok(())
    }
}
