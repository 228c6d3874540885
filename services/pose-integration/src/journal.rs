//! The journal: all that a run's results are made from. A file of poses, each with its motion and a check word.
//!
//! One `write` a record. A record that was cut short by a death is found by its check word and cut off; what was in it had
//! not been published yet. (A loss of power may take more: the operating system writes to the disk when it likes.)

use std::{
    fs::{self, File, OpenOptions},
    io::{self, Read, Write},
    path::{Path, PathBuf},
};

use gyre_messages::PoseHeader;
use thiserror::Error;

/// What a journal starts with; the number is the version of its records.
const MAGIC: [u8; 16] = *b"gyre journal v3\n";
const POSE: usize = size_of::<PoseHeader>();
const RECORD: usize = POSE + 8;

/// Why a journal cannot be used.
#[derive(Debug, Error)]
pub enum JournalError {
    /// The file.
    #[error("journal {path}: {source}")]
    File {
        /// Which.
        path: PathBuf,
        /// What the operating system said.
        source: io::Error,
    },
    /// Another program's, or another version's.
    #[error("{path} is not a journal of this version: move it away, or choose another --out")]
    Foreign {
        /// Which.
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

/// Where the journal of the run that writes to `out` lies.
pub fn path(out: &Path) -> PathBuf {
    out.join("journal").join("poses.journal")
}

/// All sound records of a journal, oldest first; none where there is no journal.
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
    (check == check_word(pose)).then(|| bytemuck::pod_read_unaligned(pose))
}

fn check_word(pose: &[u8]) -> [u8; 8] {
    u64::from(crc32fast::hash(pose)).to_le_bytes()
}

impl Journal {
    /// Opens or begins a journal, cuts off what is not sound, and returns what it holds.
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
    pub fn append(&mut self, pose: &PoseHeader) -> Result<(), JournalError> {
        let bytes = bytemuck::bytes_of(pose);
        self.record[..POSE].copy_from_slice(bytes);
        self.record[POSE..].copy_from_slice(&check_word(bytes));
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
    fn what_was_appended_is_there_again() {
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
    fn a_torn_tail_is_cut_off_wherever_it_tore() {
        let directory = tempfile::tempdir().unwrap();
        let path = path(directory.path());
        let (mut journal, _) = Journal::open(&path).unwrap();
        (0..2).for_each(|seq| journal.append(&pose(seq)).unwrap());
        let whole = fs::read(&path).unwrap();
        for torn in 0..whole.len() {
            fs::write(&path, &whole[..torn]).unwrap();
            let expected = torn.saturating_sub(MAGIC.len()) / RECORD;
            let (mut journal, records) = Journal::open(&path).unwrap();
            assert_eq!(records.len(), expected, "torn at {torn}");
            journal.append(&pose(9)).unwrap();
            assert_eq!(read(&path).unwrap().len(), expected + 1, "torn at {torn}");
        }
    }

    #[test]
    fn another_programs_file_is_refused() {
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
