//! MCAP files that may be damaged or cut: their records one after another, and the messages in a
//! place of a file.
//!
//! The reader of the `mcap` crate takes the lengths that a damaged file states as they are, and
//! allocates them. Here nothing is larger than the bytes of the file, or than a limit where they
//! are compressed, and no damage is a panic.

mod parse;

use std::{
    collections::{BTreeMap, BTreeSet},
    fs::File,
    io,
    ops::Range,
    os::unix::fs::FileExt,
    path::{Path, PathBuf},
};

use mcap::{
    MAGIC, McapError,
    records::{Metadata, Record, op},
};

use crate::RecordingError;
use parse::{Field, fields, records};
pub(crate) use parse::{next, parse};

/// Bytes of opcode and length before each record.
const PREFIX: u64 = 9;
/// The largest place that is read, bytes. A chunk of ROS 2 has 768 kB, a chunk of Gyre 4 MB and a
/// scan.
const MAX_SPAN_BYTES: u64 = 256 << 20;
/// The first opcode of records that are of one program.
const OWN: u8 = 0x80;
/// Damaged places behind which a file is not read.
const MAX_PLACES: usize = 4096;
/// Bytes that are searched at once for the record behind a damaged one.
const WINDOW: usize = 1 << 16;
/// Whole records in a row that must follow a damaged place.
const CHAIN: usize = 3;
/// The largest number of channels and of schemas of a file, the longest name of a topic, and the
/// bytes of a schema that are kept.
const MAX_CHANNELS: usize = 4096;
const MAX_NAME_BYTES: usize = 1024;
const MAX_SCHEMA_BYTES: usize = 4096;
/// The place of its times in a chunk, and of its time in a message, behind opcode and length.
const CHUNK_TIMES: Range<usize> = 9..25;
const MESSAGE_TIME: Range<usize> = 15..23;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Span {
    pub offset: u64,
    /// Bytes of the records with their opcodes and lengths.
    pub bytes: u64,
}

impl Span {
    pub fn end(self) -> u64 {
        self.offset + self.bytes
    }
}

/// A first and last time, ns since 1970; `None` without messages.
pub(crate) type Times = Option<(u64, u64)>;

pub(crate) fn joined(times: Times, others: Times) -> Times {
    match (times, others) {
        (Some((first, last)), Some(other)) => Some((first.min(other.0), last.max(other.1))),
        (times, others) => times.or(others),
    }
}

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Channel {
    pub topic: String,
    /// The type, such as `nav_msgs/msg/Odometry`.
    pub type_name: String,
    pub schema: String,
    pub encoding: String,
}

#[derive(Clone, Debug)]
pub(crate) struct Message {
    pub channel: u16,
    pub sequence: u32,
    /// When it was received, ns since 1970.
    pub log_ns: i64,
    pub data: Vec<u8>,
}

#[derive(Debug)]
pub struct McapFile {
    pub(crate) path: PathBuf,
    file: File,
    bytes: u64,
    /// The position behind the last record: in a file that has no end, the first byte that cannot
    /// be read.
    offset: u64,
    /// True if the file has chunks: then the records within a damaged one are not taken for others.
    has_chunks: bool,
    /// True if the end of the data was found, as a writer leaves it that was not killed.
    pub(crate) is_complete: bool,
    /// The positions of the damaged places so far, at most [`MAX_PLACES`].
    pub(crate) damage: BTreeSet<u64>,
    schemas: BTreeMap<u16, (String, String)>,
    pub(crate) channels: BTreeMap<u16, Channel>,
}

impl McapFile {
    /// Opens a file behind the signature of MCAP.
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        let failed = |error| RecordingError::io(path, error);
        let file = gyre_storage::open(path).map_err(failed)?;
        let bytes = file.metadata().map_err(failed)?.len();
        if number(&file, 0).map_err(failed)?.to_le_bytes() != MAGIC {
            let reason = "does not begin with the signature of MCAP: it is another file, or was not copied whole";
            let path = path.display();
            return Err(RecordingError::Other(format!("{path} {reason}")));
        }
        Ok(Self {
            path: path.to_owned(),
            file,
            bytes,
            offset: MAGIC.len() as u64,
            has_chunks: false,
            is_complete: false,
            damage: BTreeSet::new(),
            schemas: BTreeMap::new(),
            channels: BTreeMap::new(),
        })
    }

    /// Returns the opcode and the place of the next record, past those that are damaged; `None`
    /// where the file ends, or ends within it. Of a record only the lengths of its fields are read:
    /// they must add up to its own.
    pub fn next_record(&mut self) -> Result<Option<(u8, Span)>, RecordingError> {
        let next = self.find_next();
        let next = next.map_err(|error| RecordingError::io(&self.path, error))?;
        self.is_complete |= matches!(next, Some((op::DATA_END | op::FOOTER, _)));
        Ok(next)
    }

    fn find_next(&mut self) -> io::Result<Option<(u8, Span)>> {
        while self.offset + PREFIX <= self.bytes {
            let (opcode, span) = self.stated(self.offset)?;
            self.has_chunks |= opcode == op::CHUNK;
            if self.is_whole(opcode, span)? {
                self.offset = span.end();
                return Ok(Some((opcode, span)));
            }
            match self.next_whole()? {
                Some(next) if self.damage.len() < MAX_PLACES => {
                    self.damage.insert(self.offset);
                    self.offset = next;
                }
                _ => break,
            }
        }
        Ok(None)
    }

    /// Returns a record of metadata; `None` of another record, and of a damaged one.
    pub(crate) fn metadata(
        &mut self,
        opcode: u8,
        span: Span,
    ) -> Result<Option<Metadata>, RecordingError> {
        if opcode != op::METADATA {
            return Ok(None);
        }
        let bytes = self.content(span)?;
        match parse(opcode, bytes.get(PREFIX as usize..).unwrap_or_default()) {
            Ok(Record::Metadata(record)) => Ok(Some(record)),
            _ => {
                self.damage.insert(span.offset);
                Ok(None)
            }
        }
    }

    pub(crate) fn times_ns(&self, opcode: u8, span: Span) -> Result<Times, RecordingError> {
        let place = match opcode {
            op::CHUNK => CHUNK_TIMES,
            op::MESSAGE => MESSAGE_TIME,
            _ => return Ok(None),
        };
        let bytes = span.bytes.min(place.end as u64);
        let head = self.content(Span { bytes, ..span })?;
        let (numbers, _) = head.get(place).unwrap_or_default().as_chunks::<8>();
        let times = numbers.iter().map(|bytes| u64::from_le_bytes(*bytes));
        // A chunk without messages has zeros.
        let times = times.filter(|time| *time > 0);
        Ok(times.fold(None, |times, time| joined(times, Some((time, time)))))
    }

    /// Returns the messages in a place that are of wanted channels, and learns the channels there.
    pub(crate) fn read(
        &mut self,
        span: Span,
        wanted: impl Fn(&Channel) -> bool,
    ) -> Result<Vec<Message>, RecordingError> {
        let mut messages = Vec::new();
        let read = match span.bytes > MAX_SPAN_BYTES {
            true => Err(McapError::ChunkTooLarge(span.bytes)),
            false => {
                let bytes = self.content(span)?;
                records(&bytes, |record| {
                    self.learn(record, &wanted).map_or(0, |message| {
                        let kept = size_of::<Message>() + message.data.len();
                        messages.push(message);
                        kept
                    })
                })
            }
        };
        match read {
            Ok(()) => Ok(messages),
            Err(error) => {
                self.damage.insert(span.offset);
                Err(RecordingError::damaged(&self.path, span.offset, error))
            }
        }
    }

    fn learn(&mut self, record: Record<'_>, wanted: &impl Fn(&Channel) -> bool) -> Option<Message> {
        match record {
            Record::Schema { header, data }
                if self.schemas.len() < MAX_CHANNELS && header.name.len() <= MAX_NAME_BYTES =>
            {
                let text = &data[..data.len().min(MAX_SCHEMA_BYTES)];
                let text = String::from_utf8_lossy(text).into_owned();
                self.schemas.insert(header.id, (header.name, text));
            }
            Record::Channel(channel)
                if self.channels.len() < MAX_CHANNELS
                    && channel.topic.len() <= MAX_NAME_BYTES
                    && !channel.topic.contains(char::is_control) =>
            {
                let schema = self.schemas.get(&channel.schema_id).cloned();
                let (type_name, schema) = schema.unwrap_or_default();
                let learned = Channel {
                    topic: channel.topic,
                    type_name,
                    schema,
                    encoding: channel.message_encoding,
                };
                self.channels.insert(channel.id, learned);
            }
            Record::Message { header, data } if wanted(self.channels.get(&header.channel_id)?) => {
                return Some(Message {
                    channel: header.channel_id,
                    sequence: header.sequence,
                    log_ns: i64::try_from(header.log_time).unwrap_or(i64::MAX),
                    data: data.into_owned(),
                });
            }
            _ => {}
        }
        None
    }

    /// Returns a sentence about damaged or missing parts, as far as the file has been read; `None`
    /// if nothing is missing. `needs_end`: a missing end counts.
    pub(crate) fn damage(&self, needs_end: bool) -> Option<String> {
        let (path, end) = (self.path.display(), self.offset);
        let Some(first) = self.damage.first() else {
            return (needs_end && !self.is_complete).then(|| {
                format!("{path} has no end behind byte {end}: its recorder was killed, or it was not copied whole")
            });
        };
        let places = match self.damage.len() {
            1 => String::new(),
            places => format!(", the first of {places} places"),
        };
        Some(format!(
            "{path} is damaged at byte {first}{places}: what was there is left out"
        ))
    }

    /// Reads the bytes of a place, up to the end of the file.
    fn content(&self, span: Span) -> Result<Vec<u8>, RecordingError> {
        let failed = |error| RecordingError::io(&self.path, error);
        let length = self.file.metadata().map_err(failed)?.len();
        let left = length.saturating_sub(span.offset);
        let mut bytes = vec![0; left.min(span.bytes) as usize];
        let read = self.file.read_exact_at(&mut bytes, span.offset);
        read.map_err(failed)?;
        Ok(bytes)
    }

    /// Returns the opcode of a record and the place that it states.
    fn stated(&self, offset: u64) -> io::Result<(u8, Span)> {
        let mut prefix = [0; PREFIX as usize];
        self.file.read_exact_at(&mut prefix, offset)?;
        let [opcode, length @ ..] = prefix;
        let bytes = PREFIX.saturating_add(u64::from_le_bytes(length));
        Ok((opcode, Span { offset, bytes }))
    }

    /// Returns whether a record lies in the file and its fields fill it.
    fn is_whole(&self, opcode: u8, span: Span) -> io::Result<bool> {
        if span.bytes > self.bytes - span.offset {
            return Ok(false);
        }
        match fields(opcode) {
            Some(of_it) => self.fill(of_it, span, opcode == op::MESSAGE),
            None if opcode < OWN => Ok(false),
            // A program's own record, unless it fits a standard opcode with a flipped bit.
            None => match fields(opcode ^ OWN) {
                Some(of_other) => Ok(!self.fill(of_other, span, false)?),
                None => Ok(true),
            },
        }
    }

    /// Returns whether fields fill a record, or its beginning if content follows them.
    fn fill(&self, fields: &[Field], span: Span, has_content: bool) -> io::Result<bool> {
        let mut at = span.offset + PREFIX;
        for field in fields {
            at = at.saturating_add(match field {
                Field::Bytes(bytes) => *bytes as u64,
                Field::Text | Field::Map => 4 + (number(&self.file, at)? & u64::from(u32::MAX)),
                Field::Long => number(&self.file, at)?.saturating_add(8),
            });
            if at > span.end() {
                return Ok(false);
            }
        }
        Ok(has_content || at == span.end())
    }

    /// Returns the next place behind a damaged record where one begins that is whole, with those
    /// behind it: bytes of an image may look like a short one.
    fn next_whole(&self) -> io::Result<Option<u64>> {
        let mut window = vec![0; WINDOW];
        let mut at = self.offset + 1;
        while at + PREFIX <= self.bytes {
            let bytes = WINDOW.min((self.bytes - at) as usize);
            self.file.read_exact_at(&mut window[..bytes], at)?;
            for (offset, prefix) in (at..).zip(window[..bytes].windows(PREFIX as usize)) {
                if self.may_follow(prefix) && self.begins_whole(offset)? {
                    return Ok(Some(offset));
                }
            }
            at += (bytes as u64 + 1) - PREFIX;
        }
        Ok(None)
    }

    /// Returns whether a record with this opcode and length may follow a damaged one.
    fn may_follow(&self, prefix: &[u8]) -> bool {
        let is_within = matches!(prefix[0], op::SCHEMA | op::CHANNEL | op::MESSAGE);
        // No record has a terabyte.
        let is_short = prefix[6..] == [0; 3];
        is_short && fields(prefix[0]).is_some() && !(is_within && self.has_chunks)
    }

    /// Returns whether whole records begin at a place: a chunk, whose lengths leave no doubt, or
    /// several others.
    fn begins_whole(&self, mut offset: u64) -> io::Result<bool> {
        for _ in 0..CHAIN {
            if offset + PREFIX > self.bytes {
                break;
            }
            let (opcode, span) = self.stated(offset)?;
            match self.is_whole(opcode, span)? {
                true if opcode == op::CHUNK => break,
                true => offset = span.end(),
                false => return Ok(false),
            }
        }
        Ok(true)
    }
}

/// Returns eight bytes as a number; bytes behind the end of the file are zero.
fn number(file: &File, offset: u64) -> io::Result<u64> {
    let mut bytes = [0; 8];
    file.read_at(&mut bytes, offset)?;
    Ok(u64::from_le_bytes(bytes))
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;

    use super::*;

    fn opened(content: &[u8], bytes: u64) -> Result<McapFile, RecordingError> {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(content).unwrap();
        file.as_file().set_len(bytes).unwrap();
        McapFile::open(file.path())
    }

    fn file(content: &[u8]) -> McapFile {
        opened(content, content.len() as u64).unwrap()
    }

    fn record(opcode: u8, body: &[u8]) -> Vec<u8> {
        [&[opcode], &(body.len() as u64).to_le_bytes()[..], body].concat()
    }

    #[test]
    fn a_length_beyond_the_file_is_no_record_and_one_that_fills_the_memory_is_not_read() {
        let mut content = [MAGIC, &record(5, b"abc")].concat();
        content[9..17].copy_from_slice(&u64::MAX.to_le_bytes());
        assert!(file(&content).next_record().unwrap().is_none());
        content[9..17].copy_from_slice(&(1_u64 << 29).to_le_bytes());
        // It takes no room on the disk.
        let mut file = opened(&content, 1 << 30).unwrap();
        let (_, span) = file.next_record().unwrap().unwrap();
        let refused = file.read(span, |_| true).unwrap_err().to_string();
        assert!(refused.contains("is damaged at byte 8"), "{refused}");
    }
}
