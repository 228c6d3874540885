//! The journal: a file of poses, each with its motion and a checksum, from which all results of a run are made.
//!
//! Each record is one `write`. A record that is cut short by a death is detected by its checksum and truncated; its pose had not
//! been published. A power loss may lose more records, since the file is not synchronised to the disk.

use std::{
    fs::{self, File, OpenOptions},
    io::{self, Read, Write},
    path::{Path, PathBuf},
};

use gyre_messages::PoseHeader;
use thiserror::Error;

/// The start of a journal, with the version of its records.
const MAGIC: [u8; 16] = *b"gyre journal v3\n";
const POSE: usize = size_of::<PoseHeader>();
const RECORD: usize = POSE + 8;

/// An error of a journal.
#[derive(Debug, Error)]
pub enum JournalError {
    /// The file cannot be read or written.
    #[error("journal {path}: {source}")]
    File {
        /// The file.
        path: PathBuf,
        /// The system error.
        source: io::Error,
    },
    /// The file is not a journal, or of another version.
    #[error("{path} is not a journal of this version: move it away, or choose another --out")]
    Foreign {
        /// The file.
        path: PathBuf,
    },
}

/// A journal open for appending.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    file: File,
    record: [u8; RECORD],
}

/// Returns the path of the journal of the run that writes to `out`.
pub fn path(out: &Path) -> PathBuf {
    out.join("journal").join("poses.journal")
}

/// Reads all valid records of a journal, oldest first; none if there is no journal.
///
/// # Errors
/// A file that cannot be read or is not a journal.
pub fn read(path: &Path) -> Result<Vec<PoseHeader>, JournalError> {
    match fs::read(path) {
        Ok(bytes) => records(path, &bytes),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(Vec::new()),
        Err(source) => Err(JournalError::File {
            path: path.to_owned(),
            source,
        }),
    }
}

fn records(path: &Path, bytes: &[u8]) -> Result<Vec<PoseHeader>, JournalError> {
    if bytes.len() < MAGIC.len() && MAGIC.starts_with(bytes) {
        return Ok(Vec::new());
    }
    let records = bytes
        .strip_prefix(&MAGIC)
        .ok_or_else(|| JournalError::Foreign {
            path: path.to_owned(),
        })?;
    Ok(records.chunks_exact(RECORD).map_while(decode).collect())
}

fn decode(record: &[u8]) -> Option<PoseHeader> {
    let (pose, check) = record.split_at(POSE);
    (check == checksum(pose)).then(|| bytemuck::pod_read_unaligned(pose))
}

fn checksum(pose: &[u8]) -> [u8; 8] {
    u64::from(crc32fast::hash(pose)).to_le_bytes()
}

impl Journal {
    /// Opens or creates a journal, truncates it after its last valid record, and returns its records.
    ///
    /// # Errors
    /// A file that cannot be read or written, or is not a journal.
    pub fn open(path: &Path) -> Result<(Self, Vec<PoseHeader>), JournalError> {
        let failed = |source| JournalError::File {
            path: path.to_owned(),
            source,
        };
        if let Some(directory) = path.parent() {
            fs::create_dir_all(directory).map_err(failed)?;
        }
        let mut file = OpenOptions::new()
            .create(true)
            .truncate(false)
            .read(true)
            .write(true)
            .open(path)
            .map_err(failed)?;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).map_err(failed)?;
        let records = records(path, &bytes)?;
        if records.is_empty() {
            file.set_len(0).map_err(failed)?;
            file = OpenOptions::new().append(true).open(path).map_err(failed)?;
            file.write_all(&MAGIC).map_err(failed)?;
        } else {
            file.set_len((MAGIC.len() + records.len() * RECORD) as u64)
                .map_err(failed)?;
            file = OpenOptions::new().append(true).open(path).map_err(failed)?;
        }
        Ok((
            Self {
                path: path.to_owned(),
                file,
                record: [0; RECORD],
            },
            records,
        ))
    }

    /// Appends a pose.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn append(&mut self, pose: &PoseHeader) -> Result<(), JournalError> {
        let bytes = bytemuck::bytes_of(pose);
        self.record[..POSE].copy_from_slice(bytes);
        self.record[POSE..].copy_from_slice(&checksum(bytes));
        self.file
            .write_all(&self.record)
            .map_err(|source| JournalError::File {
                path: self.path.clone(),
                source,
            })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use gyre_messages::Item;

    use super::*;

    fn pose(seq: u64) -> PoseHeader {
        PoseHeader {
            item: Item {
                seq,
                ..Item::default()
            },
            x_m: seq as f64,
            ..PoseHeader::default()
        }
    }

    fn seqs(records: &[PoseHeader]) -> Vec<u64> {
        records.iter().map(|pose| pose.item.seq).collect()
    }

    #[test]
    fn appended_poses_are_read_back() {
        let directory = tempfile::tempdir().unwrap();
        let path = path(directory.path());
        let (mut journal, records) = Journal::open(&path).unwrap();
        assert!(records.is_empty());
        (0..3).for_each(|seq| journal.append(&pose(seq)).unwrap());
        assert_eq!(seqs(&read(&path).unwrap()), [0, 1, 2]);
        let (mut journal, records) = Journal::open(&path).unwrap();
        assert_eq!(seqs(&records), [0, 1, 2]);
        journal.append(&pose(3)).unwrap();
        assert_eq!(seqs(&read(&path).unwrap()), [0, 1, 2, 3]);
    }

    #[test]
    fn an_incomplete_record_is_truncated_at_any_length() {
        let directory = tempfile::tempdir().unwrap();
        let path = path(directory.path());
        let (mut journal, _) = Journal::open(&path).unwrap();
        (0..2).for_each(|seq| journal.append(&pose(seq)).unwrap());
        let complete = fs::read(&path).unwrap();
        for length in 0..complete.len() {
            fs::write(&path, &complete[..length]).unwrap();
            let expected = length.saturating_sub(MAGIC.len()) / RECORD;
            let (mut journal, records) = Journal::open(&path).unwrap();
            assert_eq!(records.len(), expected, "{length} bytes");
            journal.append(&pose(9)).unwrap();
            assert_eq!(read(&path).unwrap().len(), expected + 1, "{length} bytes");
        }
    }

    #[test]
    fn another_programs_file_is_rejected() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("poses.journal");
        fs::write(&path, b"something else altogether").unwrap();
        assert!(matches!(
            Journal::open(&path),
            Err(JournalError::Foreign { .. })
        ));
        assert_eq!(fs::read(&path).unwrap(), b"something else altogether");
    }
}
