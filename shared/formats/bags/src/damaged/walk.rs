//! The places of records in a file, up to its end or to where its writer was killed.

use std::{fs::File, io, os::unix::fs::FileExt, path::Path};

use mcap::{MAGIC, records::op};

use super::parse::{Field, fields};

/// Bytes of opcode and length before each record.
const PREFIX: u64 = 9;
/// The largest place that is read, bytes. Chunks of ROS 2 have 768 kB, those of Gyre 4 MB and a
/// scan.
const MAX_SPAN_BYTES: u64 = 256 << 20;
/// The first opcode of records that are of one program.
const OWN: u8 = 0x80;
/// Bytes that are searched at once for the record behind a damaged one.
const WINDOW: usize = 1 << 16;
/// Whole records in a row of which a damaged place is followed.
const CHAIN: usize = 3;

/// The place of records in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Span {
    /// Position of the first opcode.
    pub offset: u64,
    /// Bytes of the records with their opcodes and lengths.
    pub bytes: u64,
}

impl Span {
    /// Returns the position behind the records.
    pub fn end(self) -> u64 {
        self.offset + self.bytes
    }
}

/// The damaged places of a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Damage {
    /// Their number.
    pub places: u64,
    /// The position of the first.
    pub first: u64,
}

impl Damage {
    /// Counts a damaged place.
    pub fn add(&mut self, offset: u64) {
        if self.places == 0 {
            self.first = offset;
        }
        self.places += 1;
    }

    /// Returns a sentence about a file, which has no end if the last record that can be read ends
    /// at `cut_at`; `None` if nothing of the file is missing.
    pub fn of_file(&self, path: &Path, cut_at: Option<u64>) -> Option<String> {
        let path = path.display();
        match (self.places, cut_at) {
            (0, None) => None,
            (0, Some(end)) => Some(format!(
                "{path} has no end behind byte {end}: its recorder was killed, or it was not copied whole"
            )),
            (places, _) => {
                let places = match places {
                    1 => String::new(),
                    _ => format!(", the first of {places} places"),
                };
                let first = self.first;
                Some(format!(
                    "{path} is damaged at byte {first}{places}: what was there is left out"
                ))
            }
        }
    }
}

/// Walks over a file from record to record, past those that are damaged. Of a record only the
/// lengths of its fields are read: they must add up to its own.
pub struct Walk<'a> {
    file: &'a File,
    offset: u64,
    bytes: u64,
    /// True if the file has chunks: then the records within a damaged one are not taken for others.
    has_chunks: bool,
    damage: Damage,
}

impl<'a> Walk<'a> {
    /// Begins behind the signature of MCAP; `None` if the file does not begin with it.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn new(file: &'a File) -> io::Result<Option<Self>> {
        let bytes = file.metadata()?.len();
        let signature = number(file, 0)?.map(u64::to_le_bytes);
        let has_signature = signature.is_some_and(|signature| signature == MAGIC);
        Ok(has_signature.then_some(Self {
            file,
            offset: MAGIC.len() as u64,
            bytes,
            has_chunks: false,
            damage: Damage::default(),
        }))
    }

    /// Returns the opcode and the place of the next record; `None` where the file ends, or ends
    /// within it.
    ///
    /// # Errors
    /// The file cannot be read.
    #[allow(clippy::should_implement_trait)]
    pub fn next(&mut self) -> io::Result<Option<(u8, Span)>> {
        while self.offset + PREFIX <= self.bytes {
            let (opcode, span) = self.stated(self.offset)?;
            self.has_chunks |= opcode == op::CHUNK;
            if self.is_whole(opcode, span)? {
                self.offset = span.end();
                return Ok(Some((opcode, span)));
            }
            let Some(next) = self.next_whole()? else {
                break;
            };
            self.damage.add(self.offset);
            self.offset = next;
        }
        Ok(None)
    }

    /// Counts a record whose content is damaged.
    pub fn note(&mut self, record: Span) {
        self.damage.add(record.offset);
    }

    /// Returns the damaged places so far.
    pub fn damage(&self) -> Damage {
        self.damage
    }

    /// Returns the position behind the last record: in a file that has no end, the first byte that
    /// cannot be read.
    pub fn offset(&self) -> u64 {
        self.offset
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
            // A program's own record, and not a chunk of whose opcode a bit is flipped.
            None => {
                let of_chunk = fields(op::CHUNK).unwrap_or_default();
                Ok(!self.fill(of_chunk, span, false)?)
            }
        }
    }

    /// Returns whether fields fill a record, or its beginning if content follows them.
    fn fill(&self, fields: &[Field], span: Span, has_content: bool) -> io::Result<bool> {
        let mut at = span.offset + PREFIX;
        for field in fields {
            let bytes = match field {
                Field::Bytes(bytes) => Some(*bytes as u64),
                Field::Text | Field::Map => {
                    let length = number(self.file, at)?.map(|length| length & u64::from(u32::MAX));
                    length.map(|length| length + 4)
                }
                Field::Long => number(self.file, at)?.map(|length| length.saturating_add(8)),
            };
            at = bytes.map_or(u64::MAX, |bytes| at.saturating_add(bytes));
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

/// Returns eight bytes as a number; those behind the end of the file are zero, all of them `None`.
fn number(file: &File, offset: u64) -> io::Result<Option<u64>> {
    let mut bytes = [0; 8];
    let read = file.read_at(&mut bytes, offset)?;
    Ok((read > 0).then_some(u64::from_le_bytes(bytes)))
}

/// Reads what a file has of a place. A walk over the same file goes on as before.
///
/// # Errors
/// The file cannot be read, or the place is larger than any that a writer leaves.
pub fn read(file: &File, span: Span) -> io::Result<Vec<u8>> {
    if span.bytes > MAX_SPAN_BYTES {
        let reason = format!(
            "the record at byte {} is larger than {} MB, as in no file of ROS 2 or Gyre",
            span.offset,
            MAX_SPAN_BYTES >> 20
        );
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, reason));
    }
    let left = file.metadata()?.len().saturating_sub(span.offset);
    let mut bytes = vec![0; left.min(span.bytes) as usize];
    file.read_exact_at(&mut bytes, span.offset)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::io::Write as _;

    use super::*;

    fn file(content: &[u8]) -> File {
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(content).unwrap();
        file
    }

    fn record(opcode: u8, body: &[u8]) -> Vec<u8> {
        [&[opcode], &(body.len() as u64).to_le_bytes()[..], body].concat()
    }

    #[test]
    fn whole_records_are_found_and_one_that_is_cut_ends_the_walk() {
        let (first, second) = (record(0x85, b"abc"), record(0x86, &[7; 5000]));
        let whole = [MAGIC, &first, &second].concat();
        for cut in [0, 1, 4999, 5008] {
            let file = file(&whole[..whole.len() - cut]);
            let mut walk = Walk::new(&file).unwrap().unwrap();
            let (opcode, span) = walk.next().unwrap().unwrap();
            assert_eq!((opcode, span.offset, span.bytes), (0x85, 8, 12));
            assert_eq!(read(&file, span).unwrap(), first);
            let found = walk.next().unwrap();
            assert_eq!(found.is_some(), cut == 0);
            if let Some((_, span)) = found {
                assert_eq!(span.end(), whole.len() as u64);
                assert!(walk.next().unwrap().is_none());
            }
        }
    }

    #[test]
    fn lengths_beyond_the_file_end_the_walk() {
        let mut content = [MAGIC, &record(5, b"abc")].concat();
        content[9..17].copy_from_slice(&u64::MAX.to_le_bytes());
        let file = file(&content);
        assert!(Walk::new(&file).unwrap().unwrap().next().unwrap().is_none());
    }

    #[test]
    fn a_record_that_would_fill_the_memory_is_refused() {
        let mut content = [MAGIC, &record(5, b"abc")].concat();
        content[9..17].copy_from_slice(&(1_u64 << 29).to_le_bytes());
        let file = file(&content);
        // It takes no room on the disk.
        file.set_len(1 << 30).unwrap();
        let mut walk = Walk::new(&file).unwrap().unwrap();
        let (_, span) = walk.next().unwrap().unwrap();
        let refused = read(&file, span).unwrap_err().to_string();
        assert!(
            refused.contains("at byte 8 is larger than 256 MB"),
            "{refused}"
        );
    }

    #[test]
    fn other_files_are_not_walked() {
        assert!(Walk::new(&file(b"\x89PNG\r\n")).unwrap().is_none());
        assert!(Walk::new(&file(b"")).unwrap().is_none());
    }
}
