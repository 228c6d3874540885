//! The reader of a log: the places of its records.

use std::{
    fs::File,
    io,
    os::unix::fs::FileExt,
    path::{Path, PathBuf},
};

use super::{LogError, LogKind, LogMagic, MAX_BYTES, OURS};
use crate::{GroupSync, StorageError, durable::may_begin};

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
    index: u32,
    danger: u32,
    length: u32,
    check: u32,
}

impl Header {
    fn encode(&self) -> [u8; HEADER] {
        let mut bytes = [0; HEADER];
        let words = [self.index, self.danger, self.length, self.check];
        for (bytes, word) in bytes.chunks_exact_mut(4).zip(words) {
            bytes.copy_from_slice(&word.to_le_bytes());
        }
        let check = crc32fast::hash(&bytes[..16]);
        bytes[16..].copy_from_slice(&check.to_le_bytes());
        bytes
    }

    /// Decodes the header of a record; `None` if it is not valid.
    fn decode(bytes: &[u8]) -> Option<Self> {
        let (content, check) = bytes.get(..HEADER)?.split_at(16);
        let valid = crc32fast::hash(content).to_le_bytes() == check;
        let mut words = content.as_chunks::<4>().0.iter();
        let mut next = || words.next().map(|word| u32::from_le_bytes(*word));
        let header = Self {
            index: next()?,
            danger: next()?,
            length: next()?,
            check: next()?,
        };
        (valid && header.length as usize <= MAX_BYTES).then_some(header)
    }

    fn record(&self) -> u64 {
        bytes_in_file(self.length as usize)
    }

    /// The number of the first record that may have been in danger when this one was written.
    fn first_in_danger(&self) -> usize {
        let in_danger = self.danger.checked_sub(1);
        let in_danger = in_danger.map_or(IN_DANGER - 1, |count| count as usize);
        (self.index as usize).saturating_sub(in_danger)
    }
}

/// Returns the bytes in a file of a record of so many bytes.
const fn bytes_in_file(length: usize) -> u64 {
    (HEADER + length.next_multiple_of(ALIGNMENT)) as u64
}

/// Encodes the record number `index`, in place of the content of `bytes`.
pub(super) fn encode(index: usize, danger: u32, record: &[u8], bytes: &mut Vec<u8>) -> Header {
    let header = Header {
        index: index as u32,
        danger,
        length: record.len() as u32,
        check: crc32fast::hash(record),
    };
    bytes.clear();
    bytes.extend_from_slice(&header.encode());
    bytes.extend_from_slice(record);
    bytes.resize(header.record() as usize, 0);
    header
}

/// Reads a log while another process may append to it. It needs 24 bytes of memory for each record,
/// and none if all have the same length.
#[derive(Debug)]
pub struct LogReader {
    path: PathBuf,
    magic: LogMagic,
    /// `None` until the file exists.
    file: Option<File>,
    /// True if the file has its whole magic.
    pub(super) has_magic: bool,
    places: Places,
    unchanged: usize,
    /// The last record that was found whole, with its number.
    newest: Option<(usize, Header)>,
    /// Bytes behind the complete records.
    behind: u64,
}

#[derive(Debug)]
enum Places {
    Listed(Vec<Place>),
    /// Records of one length, and how many there are.
    Equal {
        length: usize,
        count: usize,
    },
}

#[derive(Clone, Copy, Debug)]
struct Place {
    header: Header,
    end: u64,
}

impl LogReader {
    /// Opens a log and finds its complete records. One that does not exist yet is empty.
    pub fn open(path: &Path, kind: LogKind) -> Result<Self, LogError> {
        let mut reader = Self::new(path, kind);
        reader.refresh()?;
        Ok(reader)
    }

    /// The reader of a log that has not been looked at.
    pub(super) fn new(path: &Path, kind: LogKind) -> Self {
        let places = match kind.length {
            None => Places::Listed(Vec::new()),
            Some(length) => Places::Equal { length, count: 0 },
        };
        Self {
            path: path.to_owned(),
            magic: kind.magic,
            file: None,
            has_magic: false,
            places,
            unchanged: 0,
            newest: None,
            behind: 0,
        }
    }

    /// Returns the number of complete records at the last [`refresh`](Self::refresh).
    pub fn len(&self) -> usize {
        match &self.places {
            Places::Listed(places) => places.len(),
            Places::Equal { count, .. } => *count,
        }
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the number of records behind the complete ones, if all have one length.
    pub fn torn(&self) -> usize {
        match &self.places {
            Places::Listed(_) => 0,
            Places::Equal { length, .. } => (self.behind / bytes_in_file(*length)) as usize,
        }
    }

    pub(super) fn has_one_length(&self) -> bool {
        matches!(self.places, Places::Equal { .. })
    }

    pub(super) fn reserve(&mut self, records: usize) {
        if let Places::Listed(places) = &mut self.places {
            places.reserve(records);
        }
    }

    /// Returns how many of the first records were known before the last [`refresh`](Self::refresh),
    /// and are the same. Fewer than were known if the process that appends was restarted and has
    /// cut some off; it may have appended others since. None then if all have the same length.
    pub fn unchanged(&self) -> usize {
        self.unchanged
    }

    pub(super) fn end(&self) -> u64 {
        self.start(self.len())
    }

    /// Returns the offset of a record, or of the next one.
    fn start(&self, index: usize) -> u64 {
        let first = size_of::<LogMagic>() as u64;
        match &self.places {
            Places::Equal { length, .. } => first + index as u64 * bytes_in_file(*length),
            Places::Listed(places) => match index.checked_sub(1) {
                None => first,
                Some(before) => places[before].end,
            },
        }
    }

    /// Returns the bytes of a record; panics beyond the last one.
    fn length_of(&self, index: usize) -> usize {
        match &self.places {
            Places::Listed(places) => places[index].header.length as usize,
            Places::Equal { length, count } => {
                assert!(index < *count, "record {index} of {count}");
                *length
            }
        }
    }

    pub(super) fn push(&mut self, header: Header) {
        let end = self.end() + header.record();
        match &mut self.places {
            Places::Listed(places) => places.push(Place { header, end }),
            Places::Equal { count, .. } => *count += 1,
        }
    }

    pub(super) fn truncate(&mut self, records: usize) {
        match &mut self.places {
            Places::Listed(places) => places.truncate(records),
            Places::Equal { count, .. } => *count = records.min(*count),
        }
    }

    /// Looks for records that were appended or cut off meanwhile; returns the number of complete
    /// ones now. Only the headers of the new ones are read, or nothing if all have the same length,
    /// and the bytes of those that may be damaged.
    pub fn refresh(&mut self) -> Result<usize, LogError> {
        let Some(length) = self.open_file()? else {
            return Ok(self.len());
        };
        self.keep_unchanged(length)?;
        self.unchanged = self.len();
        self.find_new(length)?;
        self.drop_incomplete()?;
        self.behind = length.saturating_sub(self.end());
        if self.behind > 0 {
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
                return Err(match found.starts_with(OURS) {
                    true => LogError::OtherVersion { path },
                    false => LogError::Foreign { path },
                });
            }
        }
        Ok(Some(length))
    }

    /// Forgets known records that are not in the file of this length any more. The appending
    /// process may have cut them off and appended different ones.
    fn keep_unchanged(&mut self, length: u64) -> Result<(), StorageError> {
        while let Some(last) = self.len().checked_sub(1) {
            let (known, before) = match &self.places {
                Places::Listed(places) => (places.last().map(|place| place.header), last),
                Places::Equal { .. } => {
                    let newest = self.newest.filter(|(index, _)| *index == last);
                    (newest.map(|(_, header)| header), 0)
                }
            };
            if self.end() <= length && self.header_at(self.start(last))? == known {
                break;
            }
            self.truncate(before);
        }
        Ok(())
    }

    fn find_new(&mut self, length: u64) -> Result<(), StorageError> {
        if !self.has_magic {
            return Ok(());
        }
        let first = self.start(0);
        if let Places::Equal {
            length: each,
            count,
        } = &mut self.places
        {
            let found = length.saturating_sub(first) / bytes_in_file(*each);
            *count = (*count).max(found as usize);
            return Ok(());
        }
        while let Some(header) = self.header_at(self.end())?
            && header.index as usize == self.len()
            && self.end() + header.record() <= length
        {
            self.push(header);
        }
        Ok(())
    }

    /// Drops the first damaged one of the last records, and those behind it. Those that were known
    /// before were whole, and so must the record be before all that can be damaged.
    fn drop_incomplete(&mut self) -> Result<(), LogError> {
        let mut bytes = Vec::new();
        let first = self.len().saturating_sub(IN_DANGER);
        for index in first.saturating_sub(1).max(self.unchanged)..self.len() {
            match self.read(index, &mut bytes) {
                Err(LogError::Damaged { .. }) if index >= first => {
                    self.truncate(index);
                    break;
                }
                read => self.newest = Some((index, read?)),
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
                if header.is_some_and(|it| it.first_in_danger() > self.len()) {
                    return Err(self.damaged(self.len()));
                }
            }
            // The next chunk begins with the first place that this one does not hold whole.
            offset += (last_start / ALIGNMENT * ALIGNMENT + ALIGNMENT) as u64;
        }
        Ok(())
    }

    pub fn read(&self, index: usize, bytes: &mut Vec<u8>) -> Result<Header, LogError> {
        let header = self.read_start(index, usize::MAX, bytes)?;
        match crc32fast::hash(bytes) == header.check {
            true => Ok(header),
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
        let of_record = self.length_of(index);
        bytes.resize(HEADER + length.min(of_record), 0);
        let whole = self.read_some(bytes, self.start(index))? == bytes.len();
        let is_right =
            |header: &Header| (header.index as usize, header.length as usize) == (index, of_record);
        let header = Header::decode(bytes).filter(|header| whole && is_right(header));
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
