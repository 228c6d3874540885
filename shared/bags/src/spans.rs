//! The places of messages in a file: its chunks, and the records outside of chunks.

use std::{
    fs::File,
    io::{self, BufReader, Read, Seek, SeekFrom},
    path::Path,
};

use mcap::{MAGIC, records::op};

use crate::BagError;

/// Bytes of opcode and length before each record.
const PREFIX: u64 = 9;
/// The size from which on records outside of chunks are a span of their own, bytes.
const PLAIN_BYTES: u64 = 4 << 20;

/// A chunk, or records that are read together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Span {
    /// Number of the file in the bag.
    pub file: u32,
    /// Position of the first record.
    pub offset: u64,
    /// Length.
    pub bytes: u64,
}

/// The spans of a file.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct Spans {
    /// Those with messages.
    pub messages: Vec<Span>,
    /// Those with the names of all channels, at the end of the file.
    pub summary: Vec<Span>,
    /// Whether the file goes on to its end.
    pub is_complete: bool,
}

/// Walks over a file from record to record. Their content is not read.
pub(crate) fn spans(path: &Path, file: &File, number: u32) -> Result<Spans, BagError> {
    let failed = |error| BagError::io(path, error);
    let bytes = file.metadata().map_err(failed)?.len();
    let mut reader = BufReader::with_capacity(1 << 12, file);
    reader.seek(SeekFrom::Start(0)).map_err(failed)?;
    let mut magic = [0; MAGIC.len()];
    match reader.read_exact(&mut magic) {
        Ok(()) if magic == MAGIC => {}
        Err(error) if error.kind() != io::ErrorKind::UnexpectedEof => return Err(failed(error)),
        _ => {
            let reason =
                "does not begin with the signature of MCAP: it is no bag, or was not copied whole";
            return Err(BagError::unreadable(path, reason));
        }
    }
    let mut found = Spans::default();
    let mut walk = Walk {
        number,
        offset: MAGIC.len() as u64,
        bytes,
        plain: None,
    };
    while let Some((opcode, span)) = walk.next(&mut reader).map_err(failed)? {
        match opcode {
            op::CHUNK => {
                walk.flush(&mut found.messages);
                found.messages.push(span);
            }
            op::SCHEMA | op::CHANNEL if found.is_complete => found.summary.push(span),
            op::SCHEMA | op::CHANNEL | op::MESSAGE => walk.collect(span, &mut found.messages),
            op::DATA_END | op::FOOTER => {
                walk.flush(&mut found.messages);
                found.is_complete = true;
            }
            _ => walk.flush(&mut found.messages),
        }
    }
    walk.flush(&mut found.messages);
    Ok(found)
}

struct Walk {
    number: u32,
    offset: u64,
    bytes: u64,
    /// Records outside of chunks.
    plain: Option<Span>,
}

impl Walk {
    /// Returns the next record; `None` where the file ends.
    fn next(&mut self, reader: &mut BufReader<&File>) -> io::Result<Option<(u8, Span)>> {
        let left = self.bytes - self.offset;
        if left < PREFIX {
            return Ok(None);
        }
        let mut prefix = [0; PREFIX as usize];
        reader.read_exact(&mut prefix)?;
        let [opcode, length @ ..] = prefix;
        let length = u64::from_le_bytes(length);
        let bytes = PREFIX.saturating_add(length);
        if bytes > left {
            return Ok(None);
        }
        let span = Span {
            file: self.number,
            offset: self.offset,
            bytes,
        };
        self.offset += bytes;
        // Within the file, whose length fits.
        reader.seek_relative(length as i64)?;
        Ok(Some((opcode, span)))
    }

    /// Adds a record to those that are read together.
    fn collect(&mut self, span: Span, spans: &mut Vec<Span>) {
        let plain = self.plain.get_or_insert(Span { bytes: 0, ..span });
        plain.bytes += span.bytes;
        if plain.bytes >= PLAIN_BYTES {
            self.flush(spans);
        }
    }

    fn flush(&mut self, spans: &mut Vec<Span>) {
        spans.extend(self.plain.take());
    }
}
