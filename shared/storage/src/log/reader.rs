//! The reader of a log: the places of its records.

use std::{
    fs::File,
    io,
    os::unix::fs::FileExt,
    path::{Path, PathBuf},
};

use super::{LogError, LogMagic, MAX_BYTES};
use crate::{GroupSync, StorageError, may_begin};

const HEADER: usize = 20;
/// A record begins at a multiple of so many bytes.
const ALIGNMENT: usize = 4;
/// A record takes at most so many more bytes in the file than it has.
pub(super) const MARGIN: usize = HEADER + ALIGNMENT;
/// Bytes that are read at once in search of a header.
const CHUNK: usize = 1 << 16;
/// Number of records at the end that a death or a power failure can have damaged: those in danger,
/// and the one being written.
const IN_DANGER: usize = GroupSync::LIMIT as usize + 1;

/// The most bytes that a death or a power failure can leave behind the complete records.
const LONGEST_END: u64 = (IN_DANGER * (MAX_BYTES + MARGIN)) as u64;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    index: u64,
    length: u32,
    check: u32,
}

impl Header {
    fn encode(&self) -> [u8; HEADER] {
        let mut bytes = [0; HEADER];
        bytes[..8].copy_from_slice(&self.index.to_le_bytes());
        bytes[8..12].copy_from_slice(&self.length.to_le_bytes());
        bytes[12..16].copy_from_slice(&self.check.to_le_bytes());
        let check = crc32fast::hash(&bytes[..16]);
        bytes[16..].copy_from_slice(&check.to_le_bytes());
        bytes
    }

    /// Decodes the header of a record; `None` if it is not valid.
    fn decode(bytes: &[u8]) -> Option<Self> {
        let (content, check) = bytes.get(..HEADER)?.split_at(16);
        let valid = crc32fast::hash(content).to_le_bytes() == check;
        let header = Self {
            index: u64::from_le_bytes(*content.first_chunk()?),
            length: u32::from_le_bytes(*content[8..].first_chunk()?),
            check: u32::from_le_bytes(*content[12..].first_chunk()?),
        };
        (valid && header.length as usize <= MAX_BYTES).then_some(header)
    }

    fn record(&self) -> u64 {
        (HEADER + (self.length as usize).next_multiple_of(ALIGNMENT)) as u64
    }
}

/// Encodes the record number `index`, in place of the content of `bytes`.
pub(super) fn encode(index: usize, record: &[u8], bytes: &mut Vec<u8>) -> Header {
    let header = Header {
        index: index as u64,
        length: record.len() as u32,
        check: crc32fast::hash(record),
    };
    bytes.clear();
    bytes.extend_from_slice(&header.encode());
    bytes.extend_from_slice(record);
    bytes.resize(header.record() as usize, 0);
    header
}

/// Reads a log while another process may append to it. It needs 16 bytes of memory for each record.
#[derive(Debug)]
pub struct LogReader {
    path: PathBuf,
    magic: LogMagic,
    /// `None` until the file exists.
    file: Option<File>,
    /// True if the file has its whole magic.
    pub(super) has_magic: bool,
    places: Vec<Place>,
    unchanged: usize,
}

#[derive(Clone, Copy, Debug)]
struct Place {
    end: u64,
    length: u32,
    check: u32,
}

impl LogReader {
    /// Opens a log and finds its complete records. One that does not exist yet is empty.
    pub fn open(path: &Path, magic: LogMagic) -> Result<Self, LogError> {
        let mut reader = Self::new(path, magic);
        reader.refresh()?;
        Ok(reader)
    }

    /// The reader of a log that has not been looked at.
    pub(super) fn new(path: &Path, magic: LogMagic) -> Self {
        Self {
            path: path.to_owned(),
            magic,
            file: None,
            has_magic: false,
            places: Vec::new(),
            unchanged: 0,
        }
    }

    /// Returns the number of complete records at the last [`refresh`](Self::refresh).
    pub fn len(&self) -> usize {
        self.places.len()
    }

    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    pub(super) fn reserve(&mut self, records: usize) {
        self.places.reserve(records);
    }

    /// Returns how many of the first records were known before the last [`refresh`](Self::refresh),
    /// and are the same. Fewer than were known if the process that appends was restarted and has
    /// cut some off; it may have appended others since.
    pub fn unchanged(&self) -> usize {
        self.unchanged
    }

    pub(super) fn end(&self) -> u64 {
        self.start(self.len())
    }

    /// Returns the offset of a record, or of the next one.
    fn start(&self, index: usize) -> u64 {
        match index {
            0 => size_of::<LogMagic>() as u64,
            _ => self.places[index - 1].end,
        }
    }

    pub(super) fn push(&mut self, header: Header) {
        self.places.push(Place {
            end: self.end() + header.record(),
            length: header.length,
            check: header.check,
        });
    }

    pub(super) fn truncate(&mut self, records: usize) {
        self.places.truncate(records);
    }

    /// Looks for records that were appended or cut off meanwhile; returns the number of complete
    /// ones now. Only the headers of the new ones are read, and the bytes of those that may be
    /// damaged.
    pub fn refresh(&mut self) -> Result<usize, LogError> {
        let Some(length) = self.open_file()? else {
            return Ok(self.len());
        };
        while !self.is_last_unchanged(length)? {
            self.places.pop();
        }
        self.unchanged = self.len();
        while self.has_magic
            && let Some(header) = self.header_at(self.end())?
            && header.index == self.len() as u64
            && self.end() + header.record() <= length
        {
            self.push(header);
        }
        self.drop_incomplete()?;
        if self.end() < length {
            self.require_no_safe_record_after_end(length)?;
        }
        Ok(self.len())
    }

    /// Opens the file, unless it is open, and checks its magic. Returns its length; `None` if it
    /// does not exist.
    fn open_file(&mut self) -> Result<Option<u64>, LogError> {
        let failed = StorageError::at("read", &self.path);
        let file = match self.file.take().map_or_else(|| crate::open(&self.path), Ok) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            opened => self.file.insert(opened.map_err(&failed)?),
        };
        let length = file.metadata().map_err(&failed)?.len();
        if !self.has_magic {
            let mut found = LogMagic::default();
            let bytes = self.read_some(&mut found, 0)?;
            self.has_magic = found == self.magic;
            if !may_begin(&found[..bytes], &self.magic) {
                let path = self.path.clone();
                return Err(LogError::Foreign { path });
            }
        }
        Ok(Some(length))
    }

    /// Returns whether the last known record is still in the file of this length. The appending
    /// process may have cut it off and appended a different one.
    fn is_last_unchanged(&self, length: u64) -> Result<bool, StorageError> {
        let (Some(last), Some(place)) = (self.len().checked_sub(1), self.places.last()) else {
            return Ok(true);
        };
        let known = Header {
            index: last as u64,
            length: place.length,
            check: place.check,
        };
        Ok(place.end <= length && self.header_at(self.start(last))? == Some(known))
    }

    /// Drops the first damaged one of the last records, and those behind it. Those that were known
    /// before were whole.
    fn drop_incomplete(&mut self) -> Result<(), LogError> {
        let mut bytes = Vec::new();
        let first = self.len().saturating_sub(IN_DANGER);
        for index in first.max(self.unchanged)..self.len() {
            match self.read(index, &mut bytes) {
                Err(LogError::Damaged { .. }) => {
                    self.truncate(index);
                    break;
                }
                read => read?,
            }
        }
        Ok(())
    }

    /// Checks that the record after the end was in danger when the last one in the file was
    /// written: that it was not damaged later.
    fn require_no_safe_record_after_end(&self, length: u64) -> Result<(), LogError> {
        if length - self.end() > LONGEST_END {
            return Err(self.damaged(self.len()));
        }
        let mut bytes = vec![0; CHUNK];
        let mut offset = self.end();
        while offset + HEADER as u64 <= length {
            // Records that were appended since the length was taken are no part of this look.
            let within = (length - offset).min(CHUNK as u64) as usize;
            let found = self.read_some(&mut bytes[..within], offset)?;
            let last_start = found.saturating_sub(HEADER);
            for start in (0..=last_start).step_by(ALIGNMENT) {
                let header = Header::decode(&bytes[start..found]);
                if header.is_some_and(|it| it.index >= (self.len() + IN_DANGER) as u64) {
                    return Err(self.damaged(self.len()));
                }
            }
            // The next chunk begins with the first place that this one does not hold whole.
            offset += (last_start / ALIGNMENT * ALIGNMENT + ALIGNMENT) as u64;
        }
        Ok(())
    }

    pub fn read(&self, index: usize, bytes: &mut Vec<u8>) -> Result<(), LogError> {
        let header = self.read_start(index, usize::MAX, bytes)?;
        bytes.truncate(header.length as usize);
        match crc32fast::hash(bytes) == header.check {
            true => Ok(()),
            false => Err(self.damaged(index)),
        }
    }

    /// Reads at most `length` bytes of the start of a record, which replace the content of `bytes`.
    /// They are not checked: the checksum covers the whole record.
    pub fn read_start(
        &self,
        index: usize,
        length: usize,
        bytes: &mut Vec<u8>,
    ) -> Result<Header, LogError> {
        let length = length.min(self.places[index].length as usize);
        bytes.resize(HEADER + length, 0);
        let whole = self.read_some(bytes, self.start(index))? == bytes.len();
        let header = Header::decode(bytes).filter(|header| whole && header.index == index as u64);
        bytes.drain(..HEADER);
        header.ok_or_else(|| self.damaged(index))
    }

    fn header_at(&self, offset: u64) -> Result<Option<Header>, StorageError> {
        let mut bytes = [0; HEADER];
        let whole = self.read_some(&mut bytes, offset)? == HEADER;
        Ok(Header::decode(&bytes).filter(|_| whole))
    }

    /// Fills `bytes` from `offset` on; returns how many there are up to the end of the file.
    fn read_some(&self, bytes: &mut [u8], offset: u64) -> Result<usize, StorageError> {
        let Some(file) = &self.file else {
            return Ok(0);
        };
        let mut found = 0;
        while found < bytes.len() {
            match file.read_at(&mut bytes[found..], offset + found as u64) {
                Ok(0) => break,
                Ok(count) => found += count,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(StorageError::at("read", &self.path)(error)),
            }
        }
        Ok(found)
    }

    pub fn malformed(&self, record: usize) -> LogError {
        let path = self.path.clone();
        LogError::Malformed { path, record }
    }

    fn damaged(&self, record: usize) -> LogError {
        let path = self.path.clone();
        LogError::Damaged { path, record }
    }
}
