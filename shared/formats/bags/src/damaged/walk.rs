//! The places of records in a file, up to its end or to where its writer was killed.

use std::{
    fs::File,
    io::{self, BufReader, Read, Seek, SeekFrom},
    os::unix::fs::FileExt,
};

use mcap::MAGIC;

/// Bytes of opcode and length before each record.
const PREFIX: u64 = 9;
/// The largest place that is read, bytes. Chunks of ROS 2 have 768 kB, those of Gyre 4 MB and a
/// scan.
const MAX_SPAN_BYTES: u64 = 256 << 20;

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

/// Walks over a file from record to record. Their content is not read.
pub struct Walk<'a> {
    reader: BufReader<&'a File>,
    offset: u64,
    bytes: u64,
}

impl<'a> Walk<'a> {
    /// Begins behind the signature of MCAP; `None` if the file does not begin with it.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn new(file: &'a File) -> io::Result<Option<Self>> {
        let bytes = file.metadata()?.len();
        let mut reader = BufReader::with_capacity(1 << 12, file);
        reader.seek(SeekFrom::Start(0))?;
        let mut signature = [0; MAGIC.len()];
        match reader.read_exact(&mut signature) {
            Ok(()) if signature == MAGIC => Ok(Some(Self {
                reader,
                offset: MAGIC.len() as u64,
                bytes,
            })),
            Err(error) if error.kind() != io::ErrorKind::UnexpectedEof => Err(error),
            _ => Ok(None),
        }
    }

    /// Returns the opcode and the place of the next record; `None` where the file ends, or ends
    /// within it.
    ///
    /// # Errors
    /// The file cannot be read.
    #[allow(clippy::should_implement_trait)]
    pub fn next(&mut self) -> io::Result<Option<(u8, Span)>> {
        let left = self.bytes - self.offset;
        if left < PREFIX {
            return Ok(None);
        }
        let mut prefix = [0; PREFIX as usize];
        self.reader.read_exact(&mut prefix)?;
        let [opcode, length @ ..] = prefix;
        let length = u64::from_le_bytes(length);
        let bytes = PREFIX.saturating_add(length);
        if bytes > left {
            return Ok(None);
        }
        let span = Span {
            offset: self.offset,
            bytes,
        };
        self.offset += bytes;
        // Within the file, whose length fits.
        self.reader.seek_relative(length as i64)?;
        Ok(Some((opcode, span)))
    }
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
        let (first, second) = (record(5, b"abc"), record(6, &[7; 5000]));
        let whole = [MAGIC, &first, &second].concat();
        for cut in [0, 1, 4999, 5008] {
            let file = file(&whole[..whole.len() - cut]);
            let mut walk = Walk::new(&file).unwrap().unwrap();
            let (opcode, span) = walk.next().unwrap().unwrap();
            assert_eq!((opcode, span.offset, span.bytes), (5, 8, 12));
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
