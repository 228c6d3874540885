//! Reading of a journal from its start to its end, in bounded memory.

use std::{
    fs::File,
    io::{self, BufReader, Read, Seek, SeekFrom},
    path::{Path, PathBuf},
};

use gyre_contract::PoseHeader;
use gyre_storage::{StorageError, may_begin};

use crate::{
    JournalError,
    record::{ANY_VERSION, MAGIC, RECORD, RECORDS, Record},
};

const BUFFER: usize = 1 << 20;

/// The records of a journal, oldest first. An incomplete one at the end is left out.
#[derive(Debug)]
pub struct Records {
    path: PathBuf,
    reader: BufReader<File>,
    bytes: Box<[u8; RECORD]>,
    pub(crate) next: u64,
    pub(crate) has_header: bool,
}

/// Opens a journal to read it; `None` without a journal.
pub fn records(path: &Path) -> Result<Option<Records>, JournalError> {
    Ok(Records::open(path)?.filter(|records| records.has_header))
}

/// As [`records`], from the pose number `first` on.
pub fn records_from(path: &Path, first: u64) -> Result<Option<Records>, JournalError> {
    let Some(mut records) = records(path)? else {
        return Ok(None);
    };
    let sought = records.reader.seek(SeekFrom::Start(RECORDS.offset(first)));
    sought.map_err(StorageError::at("read", path))?;
    records.next = first;
    Ok(Some(records))
}

impl Iterator for Records {
    type Item = Result<PoseHeader, JournalError>;

    fn next(&mut self) -> Option<Self::Item> {
        let index = self.next;
        Some(self.read()?.and_then(|record| {
            let record = record.ok_or_else(|| JournalError::damaged(&self.path, index))?;
            Ok(record.pose)
        }))
    }
}

impl Records {
    /// Opens a journal whose header may be torn.
    pub(crate) fn open(path: &Path) -> Result<Option<Self>, JournalError> {
        let failed = StorageError::at("read", path);
        let file = match gyre_storage::open(path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            opened => opened.map_err(&failed)?,
        };
        let mut reader = BufReader::with_capacity(BUFFER, file);
        let mut header = Vec::with_capacity(MAGIC.len());
        let mut start = reader.by_ref().take(MAGIC.len() as u64);
        start.read_to_end(&mut header).map_err(&failed)?;
        if !may_begin(&header, &MAGIC) {
            return Err(refused(&header, path));
        }
        Ok(Some(Self {
            path: path.to_owned(),
            reader,
            bytes: Box::new([0; RECORD]),
            next: 0,
            has_header: header == MAGIC,
        }))
    }

    /// Reads the next place: its record, or `None` if it is not valid. Ends at the last complete
    /// place.
    pub(crate) fn read(&mut self) -> Option<Result<Option<Record>, JournalError>> {
        match self.reader.read_exact(&mut self.bytes[..]) {
            Ok(()) => {
                let index = self.next;
                self.next += 1;
                Some(Ok(Record::decode(&self.bytes[..], index)))
            }
            Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => None,
            Err(error) => Some(Err(StorageError::at("read", &self.path)(error).into())),
        }
    }
}

/// Returns the reason why a file with such a header cannot be continued.
pub(crate) fn refused(header: &[u8], path: &Path) -> JournalError {
    let path = path.to_owned();
    match header.starts_with(ANY_VERSION) {
        true => JournalError::OtherVersion { path },
        false => JournalError::Foreign { path },
    }
}
