//! The files for resuming a run after a death or a power failure: the journal of its poses; with
//! SLAM its [`keyframes`]; with objects its [`scans`], and the [`objects`] in each; and the
//! [`checkpoint`] of its refinement.
//!
//! The journal has each pose with its motion and a checksum, written before the pose is published;
//! all results of a run are made from it. [`check`] finds what a death or a power failure has left
//! of the last records; those poses are computed again.

mod check;
pub mod checkpoint;
mod error;
pub mod keyframes;
pub mod loops;
pub mod objects;
mod record;
mod records;
pub mod scans;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

use gyre_contract::{PoseHeader, flag};
use gyre_geometry::SparsePoint;
use gyre_storage::DurableFile;

pub use check::{Content, check, cut};
pub use error::JournalError;
pub use gyre_storage::continue_when_full;
use record::{MAGIC, RECORD, RECORDS, Record};
pub use records::{Records, records, records_from};

#[derive(Debug)]
pub struct Journal {
    file: DurableFile,
    /// Number of records, and of those that were there when it was opened.
    records: u64,
    found: u64,
    buffer: [u8; RECORD],
}

/// A log of poses with the points of their scans, each appended before its pose is journalled.
pub trait PoseLog {
    /// Takes the next pose, before it is journalled. Returns whether it was appended.
    fn add(&mut self, pose: &PoseHeader, points: &[SparsePoint]) -> Result<bool, JournalError>;

    /// Marks the end of the stream, before the journal does. All records survive a power failure
    /// when this returns.
    fn end(&mut self) -> Result<(), JournalError>;

    /// Waits until all records so far survive a power failure.
    fn sync(&self) -> Result<(), JournalError>;
}

pub fn path(out: &Path) -> PathBuf {
    out.join("journal").join("poses.journal")
}

impl Journal {
    /// Opens or creates a journal and cuts off an incomplete record at its end. Only the end is
    /// read, however long it is.
    pub fn open(path: &Path) -> Result<Self, JournalError> {
        let mut records = 0;
        let file = DurableFile::open(path, |file| {
            let begin = RECORDS.start;
            records = file.length()?.saturating_sub(begin) / RECORD as u64;
            let mut header = [0; MAGIC.len()];
            if records > 0 && !(file.read_at(&mut header, 0)? && header == MAGIC) {
                return Err(records::refused(&header, path));
            }
            if records == 0 {
                // Opened to be read, it is refused if it belongs to another program.
                records::records(path)?;
                file.write_at(&MAGIC, 0)?;
            }
            Ok(file.cut_to(RECORDS.offset(records))?)
        })?;
        Ok(Self {
            file,
            records,
            found: records,
            buffer: [0; RECORD],
        })
    }

    /// Returns the last poses, at most `count`, oldest first, and whether the end of the stream
    /// follows them.
    pub fn last(&self, count: usize) -> Result<(Vec<PoseHeader>, bool), JournalError> {
        let mut poses = Vec::with_capacity(count);
        let mut ended = false;
        let mut bytes = [0; RECORD];
        for index in (0..self.records).rev() {
            if poses.len() == count {
                break;
            }
            let whole = self.file.read(&RECORDS, index, &mut bytes)?;
            let record = Record::decode(&bytes, index).filter(|_| whole);
            let damaged = || JournalError::damaged(self.file.file.path(), index);
            let pose = record.ok_or_else(damaged)?.pose;
            match pose.item.is(flag::END) {
                true => ended = true,
                false => poses.push(pose),
            }
        }
        poses.reverse();
        Ok((poses, ended))
    }

    /// Appends a pose, or the end of the stream.
    pub fn append(&mut self, pose: &PoseHeader) -> Result<(), JournalError> {
        let safe = self
            .file
            .sync
            .safe()
            .map_or(0, |appended| self.found + appended);
        let record = Record {
            pose: *pose,
            in_danger: u32::try_from(self.records - safe).unwrap_or(u32::MAX),
        };
        record.encode(&mut self.buffer);
        self.file.write(&RECORDS, self.records, &self.buffer)?;
        self.file.file.require_name()?;
        self.records += 1;
        Ok(self.file.sync.changed()?)
    }

    /// Waits until all that was appended survives a power failure.
    pub fn sync(&self) -> Result<(), JournalError> {
        self.file.file.require_name()?;
        Ok(self.file.sync.finish()?)
    }
}
