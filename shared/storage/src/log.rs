//! A log: a file of records of any length, each with a checksum, that grows at its end.
//!
//! One process appends, others read complete records meanwhile. A death cuts the last record short;
//! a power failure takes or damages at most the last
//! [`GroupSync::LIMIT`](crate::GroupSync::LIMIT) records. Those are cut off when the log is opened;
//! any other damaged record is refused with its number.
//!
//! Layout, little-endian: 16 bytes of magic; then for each record its number (u32), its danger
//! (u32), its length in bytes (u32), the CRC-32 of its bytes (u32), the CRC-32 of these four (u32),
//! its bytes, and zeros up to a multiple of four.
//!
//! The danger of a record is one more than the number of records before it that were not known to
//! survive a power failure when it was written. A damaged record of a log is
//! therefore recent, or it had been safe. Logs of records of different lengths have 0 there, so
//! that the same records are the same file.

mod reader;
#[cfg(test)]
mod tests;

use std::{
    io,
    path::{Path, PathBuf},
};

use thiserror::Error;

use crate::{Busy, DurableFile, StorageError};
pub use reader::LogReader;
use reader::encode;

/// The start of a log: the kind of its records, and their version.
pub type LogMagic = [u8; 16];
/// The first bytes of all files of Gyre that begin with a magic.
const OURS: &[u8] = b"gyre ";

/// The start of a log, and the length of its records if all have the same: then a log of any length
/// is opened at once, and in little memory.
#[derive(Clone, Copy, Debug)]
pub struct LogKind {
    pub magic: LogMagic,
    pub length: Option<usize>,
}

/// The longest record. So the memory for reading one is bounded, even for a damaged file.
const MAX_BYTES: usize = 16 << 20;
/// Records for which memory is taken at once.
const MANY: usize = 4096;

#[derive(Debug, Error)]
pub enum LogError {
    #[error(transparent)]
    Storage(#[from] StorageError),
    #[error("{path} is not a file of Gyre: move it away, or choose another --out")]
    Foreign { path: PathBuf },
    #[error("{path} is of another version of Gyre: use that one, or choose another --out")]
    OtherVersion { path: PathBuf },
    /// The record of this number, from 0.
    #[error("{path} is damaged at record {record}, although it had been written whole")]
    Damaged { path: PathBuf, record: usize },
    /// A record is undamaged, but of a different kind than this log.
    #[error("record {record} of {path} is of another kind: move it away, or choose another --out")]
    Malformed { path: PathBuf, record: usize },
    /// A file lacks records that a different file needs.
    #[error("{0}")]
    Missing(String),
    #[error(transparent)]
    Busy(#[from] Busy),
}

#[derive(Debug)]
pub struct Log {
    file: DurableFile,
    records: LogReader,
    /// Changes that were counted since the log was opened.
    changes: u64,
    /// Their number when the last record was appended.
    appended: u64,
    buffer: Vec<u8>,
}

impl Log {
    /// Opens or creates a log, and cuts off incomplete last records, left by a death or a power
    /// failure. Of the others only the headers are read, or nothing if all have the same length.
    /// The contents of the log then survive a power failure.
    pub fn open(path: &Path, kind: LogKind) -> Result<Self, LogError> {
        let mut records = LogReader::new(path, kind);
        let file = DurableFile::open(path, |file| {
            records.refresh()?;
            if !records.has_magic {
                file.set_length(0)?;
                file.write_at(&kind.magic, 0)?;
                records.refresh()?;
            }
            file.cut_to(records.end())?;
            Ok::<(), LogError>(file.sync()?)
        })?;
        Ok(Self {
            file,
            records,
            changes: 0,
            appended: 0,
            buffer: Vec::new(),
        })
    }

    pub fn len(&self) -> usize {
        self.records.len()
    }

    pub fn is_empty(&self) -> bool {
        self.records.is_empty()
    }

    /// Allocates the memory for appending records of up to `bytes` bytes: later appends allocate
    /// nothing.
    pub fn reserve(&mut self, bytes: usize) {
        self.buffer.reserve(bytes + reader::MARGIN);
        self.records.reserve(MANY);
    }

    /// Appends a record. A reader sees it when this returns.
    pub fn append(&mut self, record: &[u8]) -> Result<(), LogError> {
        if record.len() > MAX_BYTES {
            let too_long = io::ErrorKind::FileTooLarge.into();
            return Err(StorageError::at("write", self.file.file.path())(too_long).into());
        }
        let header = encode(self.len(), self.danger(), record, &mut self.buffer);
        self.file.file.write_at(&self.buffer, self.records.end())?;
        self.file.file.require_name()?;
        self.records.push(header);
        self.appended = self.changes + 1;
        self.count()
    }

    /// Counts a change of another file that is of use only with the records that were appended. At
    /// most [`GroupSync::LIMIT`](crate::GroupSync::LIMIT) of them are made before the records
    /// survive a power failure.
    pub fn rely(&mut self) -> Result<(), LogError> {
        match self.file.sync.safe() >= Some(self.appended) {
            true => Ok(()),
            false => self.count(),
        }
    }

    fn danger(&self) -> u32 {
        let in_danger = self.changes - self.file.sync.safe().unwrap_or(0);
        match self.records.has_one_length() {
            true => 1 + in_danger as u32,
            false => 0,
        }
    }

    fn count(&mut self) -> Result<(), LogError> {
        self.changes += 1;
        Ok(self.file.sync.changed()?)
    }

    /// Makes all records survive a power failure.
    pub fn sync(&self) -> Result<(), LogError> {
        self.file.file.require_name()?;
        Ok(self.file.sync.finish()?)
    }

    pub fn read(&self, index: usize, bytes: &mut Vec<u8>) -> Result<(), LogError> {
        self.records.read(index, bytes).map(drop)
    }

    pub fn malformed(&self, index: usize) -> LogError {
        self.records.malformed(index)
    }

    /// Keeps the first `records` records and cuts off those behind them. The cut survives a power
    /// failure.
    pub fn cut(&mut self, records: usize) -> Result<(), LogError> {
        if records < self.len() {
            self.records.truncate(records);
            self.file.file.set_length(self.records.end())?;
            self.file.file.sync()?;
        }
        Ok(())
    }
}
