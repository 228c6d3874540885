//! The records in a part of a file.

use mcap::{
    McapError,
    records::Record,
    sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions},
};

use super::parse::{chunks_hold_their_records, parse};

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
