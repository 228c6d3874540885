//! The places of records in a file, up to its end or to where its writer was killed.

use std::{collections::BTreeSet, fs::File, io, os::unix::fs::FileExt, path::Path};

use mcap::{MAGIC, records::op};

use super::parse::{Field, fields};

/// Bytes of opcode and length before each record.
const PREFIX: u64 = 9;
/// The largest place that is read, bytes. Chunks of ROS 2 have 768 kB, those of Gyre 4 MB and a
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

/// The positions of the damaged places of a file, at most [`MAX_PLACES`].
pub type Damage = BTreeSet<u64>;

/// Returns a sentence about the damage of a file, which has no end if the last record that can be
/// read ends at `cut_at`; `None` if nothing of the file is missing.
pub fn sentence(path: &Path, damage: &Damage, cut_at: Option<u64>) -> Option<String> {
    let path = path.display();
    let Some(first) = damage.first() else {
        return cut_at.map(|end| {
            format!("{path} has no end behind byte {end}: its recorder was killed, or it was not copied whole")
        });
    };
    let places = match damage.len() {
        1 => String::new(),
        places => format!(", the first of {places} places"),
    };
    Some(format!(
        "{path} is damaged at byte {first}{places}: what was there is left out"
    ))
}

/// Walks over a file from record to record, past those that are damaged. Of a record only the
/// lengths of its fields are read: they must add up to its own.
pub struct Walk<'a> {
    file: &'a File,
    /// The position behind the last record: in a file that has no end, the first byte that cannot
    /// be read.
    pub offset: u64,
    /// The damaged places so far.
    pub damage: Damage,
    bytes: u64,
    /// True if the file has chunks: then the records within a damaged one are not taken for others.
    has_chunks: bool,
}

impl<'a> Walk<'a> {
    /// Begins behind the signature of MCAP; `None` if the file does not begin with it.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn new(file: &'a File) -> io::Result<Option<Self>> {
        let bytes = file.metadata()?.len();
        let has_signature = number(file, 0)?.to_le_bytes() == MAGIC;
        Ok(has_signature.then(|| Self {
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
                Field::Text | Field::Map => 4 + (number(self.file, at)? & u64::from(u32::MAX)),
                Field::Long => number(self.file, at)?.saturating_add(8),
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
    fn a_record_with_a_flipped_bit_in_its_opcode_is_damage() {
        let flipped = record(op::METADATA | OWN, &[0; 8]);
        let file = file(&[MAGIC, &flipped, &record(op::DATA_END, &[0; 4])].concat());
        let mut walk = Walk::new(&file).unwrap().unwrap();
        assert_eq!(walk.next().unwrap().unwrap().0, op::DATA_END);
        assert!(walk.damage.contains(&8));
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
