//! Records from their bytes.

use std::borrow::Cow;

use mcap::{
    McapError,
    records::{Record, op},
    sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions},
};

/// The largest record that is read, bytes: several times the largest scan, and the most that a
/// recorder writes at once.
const MAX_RECORD_BYTES: usize = 128 << 20;
/// The most that is kept of a part of a file, bytes: few compressed bytes may stand for many.
const MAX_KEPT_BYTES: usize = 256 << 20;

/// Calls `keep` with all records in the bytes of a file, of chunks with those in them. It returns
/// the bytes of memory that it uses for the record. Their checksums are compared.
///
/// Incomplete records at the end are ignored.
pub(super) fn records(
    mut bytes: &[u8],
    mut keep: impl FnMut(Record<'_>) -> usize,
) -> Result<(), McapError> {
    if !chunks_hold_their_records(bytes) {
        return Err(McapError::UnexpectedEoc);
    }
    let options = LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_skip_end_magic(true)
        .with_validate_chunk_crcs(true)
        .with_record_length_limit(MAX_RECORD_BYTES);
    let (mut reader, mut kept) = (LinearReader::new_with_options(options), 0);
    while let Some(event) = reader.next_event() {
        match event? {
            LinearReadEvent::ReadRequest(_) if bytes.is_empty() => break,
            LinearReadEvent::ReadRequest(wanted) => {
                let (now, later) = bytes.split_at(wanted.min(bytes.len()));
                reader.insert(now.len()).copy_from_slice(now);
                reader.notify_read(now.len());
                bytes = later;
            }
            LinearReadEvent::Record { data, opcode } => {
                kept += keep(parse(opcode, data)?);
                if kept > MAX_KEPT_BYTES {
                    return Err(McapError::ChunkTooLarge(kept as u64));
                }
            }
        }
    }
    Ok(())
}

/// Parses a header, a schema, a channel, a message or metadata. All other records are
/// [`Record::Unknown`].
pub(crate) fn parse(opcode: u8, body: &[u8]) -> Result<Record<'_>, McapError> {
    let parsed = [
        op::HEADER,
        op::SCHEMA,
        op::CHANNEL,
        op::MESSAGE,
        op::METADATA,
    ];
    let Some(fields) = fields(opcode).filter(|_| parsed.contains(&opcode)) else {
        return Ok(Record::Unknown {
            opcode,
            data: Cow::Borrowed(body),
        });
    };
    let mut rest = body;
    match fields.iter().try_for_each(|field| field.skip(&mut rest)) {
        Some(()) => mcap::parse_record(opcode, body),
        None => Err(McapError::UnexpectedEof),
    }
}

/// Returns the fields of a record; the fields of a message come before its content. `None` for an
/// opcode that MCAP does not have.
pub(super) fn fields(opcode: u8) -> Option<&'static [Field]> {
    use Field::{Bytes, Long, Map, Text};
    Some(match opcode {
        op::HEADER => &[Text, Text],
        op::FOOTER => &[Bytes(20)],
        op::SCHEMA => &[Bytes(2), Text, Text, Text],
        op::CHANNEL => &[Bytes(4), Text, Text, Map],
        op::MESSAGE => &[Bytes(22)],
        op::CHUNK => &[Bytes(28), Text, Long],
        op::MESSAGE_INDEX => &[Bytes(2), Text],
        op::CHUNK_INDEX => &[Bytes(32), Text, Bytes(8), Text, Bytes(16)],
        op::ATTACHMENT => &[Bytes(16), Text, Text, Long, Bytes(4)],
        op::ATTACHMENT_INDEX => &[Bytes(40), Text, Text],
        op::STATISTICS => &[Bytes(42), Text],
        op::METADATA => &[Text, Map],
        op::METADATA_INDEX => &[Bytes(16), Text],
        op::SUMMARY_OFFSET => &[Bytes(17)],
        op::DATA_END => &[Bytes(4)],
        _ => return None,
    })
}

/// Returns whether the records in all chunks that are not compressed end with their chunk. The
/// reader subtracts their lengths from the chunk's, and would overflow.
fn chunks_hold_their_records(mut bytes: &[u8]) -> bool {
    while let Some((opcode, body)) = next(&mut bytes) {
        if opcode == op::CHUNK && chunk_holds_its_records(body) == Some(false) {
            return false;
        }
    }
    true
}

/// Returns `None` if the chunk is compressed, or its head is cut, which the reader sees.
fn chunk_holds_its_records(body: &[u8]) -> Option<bool> {
    // The times of its first and last message, its size and checksum.
    let (mut rest, mut compression) = (body.get(28..)?, body.get(28..)?);
    Field::Text.skip(&mut rest)?;
    if length(&mut compression)? > 0 {
        return None;
    }
    let bytes = long(&mut rest)?;
    let mut records = rest.get(..bytes)?;
    while next(&mut records).is_some() {}
    Some(records.is_empty())
}

/// Returns the opcode and the body of the next record, if it is whole.
pub(crate) fn next<'a>(bytes: &mut &'a [u8]) -> Option<(u8, &'a [u8])> {
    let (&opcode, mut rest) = bytes.split_first()?;
    let length = long(&mut rest)?;
    let (body, after) = rest.split_at_checked(length)?;
    *bytes = after;
    Some((opcode, body))
}

/// A field of a record. The parser allocates the length that the record states before it reads.
#[derive(Clone, Copy)]
pub(super) enum Field {
    Bytes(usize),
    /// The length in four bytes, and a text, or anything else.
    Text,
    /// The same with a length in eight bytes.
    Long,
    /// The length in bytes, and pairs of texts.
    Map,
}

impl Field {
    fn skip(self, rest: &mut &[u8]) -> Option<()> {
        let bytes = match self {
            Self::Bytes(bytes) => bytes,
            Self::Text => length(rest)?,
            Self::Long => long(rest)?,
            Self::Map => {
                let bytes = length(rest)?;
                let end = rest.len().checked_sub(bytes)?;
                while rest.len() > end {
                    Self::Text.skip(rest)?;
                    Self::Text.skip(rest)?;
                }
                0
            }
        };
        *rest = rest.get(bytes..)?;
        Some(())
    }
}

fn length(rest: &mut &[u8]) -> Option<usize> {
    let (length, after) = rest.split_first_chunk::<4>()?;
    *rest = after;
    usize::try_from(u32::from_le_bytes(*length)).ok()
}

fn long(rest: &mut &[u8]) -> Option<usize> {
    let (length, after) = rest.split_first_chunk::<8>()?;
    *rest = after;
    usize::try_from(u64::from_le_bytes(*length)).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(text: &str) -> Vec<u8> {
        [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat()
    }

    fn channel() -> Vec<u8> {
        let map = [text("key"), text("value")].concat();
        let map = [&(map.len() as u32).to_le_bytes()[..], &map].concat();
        [vec![1, 0, 2, 0], text("/scan"), text("cdr"), map].concat()
    }

    #[test]
    fn a_whole_record_is_parsed_and_a_cut_one_is_not() {
        let whole = channel();
        let Record::Channel(parsed) = parse(op::CHANNEL, &whole).unwrap() else {
            panic!("no channel");
        };
        assert_eq!((parsed.id, parsed.topic.as_str()), (1, "/scan"));
        assert_eq!(parsed.metadata["key"], "value");
        for bytes in 0..whole.len() {
            assert!(parse(op::CHANNEL, &whole[..bytes]).is_err(), "{bytes}");
        }
    }

    #[test]
    fn lengths_beyond_the_record_are_refused() {
        let whole = channel();
        // Of the topic, the encoding, the map, its key and its value.
        for at in [4, 13, 20, 24, 31] {
            let mut edited = whole.clone();
            edited[at..at + 4].copy_from_slice(&u32::MAX.to_le_bytes());
            assert!(parse(op::CHANNEL, &edited).is_err(), "{at}");
        }
    }

    #[test]
    fn records_that_are_longer_than_their_chunk_are_refused() {
        let record = |opcode: u8, body: &[u8]| {
            [&[opcode], &(body.len() as u64).to_le_bytes()[..], body].concat()
        };
        let inner = record(op::MESSAGE, &[0; 30]);
        let chunk = |inner: &[u8]| {
            let size = (inner.len() as u64).to_le_bytes();
            record(op::CHUNK, &[&[0; 32][..], &size, inner].concat())
        };
        assert!(chunks_hold_their_records(&chunk(&inner)));
        assert!(!chunks_hold_their_records(&chunk(&inner[..38])));
        let mut longer = inner.clone();
        longer[1] += 1;
        let bytes = [chunk(&inner), chunk(&longer)].concat();
        assert!(!chunks_hold_their_records(&bytes));
        let read = records(&bytes, |_| 0);
        assert!(matches!(read, Err(McapError::UnexpectedEoc)));
    }
}
